"""`python -m jshell`."""

from jshell.cli.main import app

if __name__ == "__main__":
    app()
