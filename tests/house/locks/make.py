"""What may only gain, written anew by `python tests/house/locks/make.py`; a gain belongs to its commit."""

import importlib
import json
import pkgutil
import tempfile
from pathlib import Path
from typing import Any

import jshell

HERE = Path(__file__).parent
WORDS = ("description", "title", "summary", "version")  # may be said better


def names() -> dict[str, list[str]]:
    """What every package announces."""
    rooms = [m.name for m in pkgutil.walk_packages(jshell.__path__, "jshell.") if m.ispkg]
    modules = {name: importlib.import_module(name) for name in ("jshell", *rooms)}
    return {name: sorted(module.__all__) for name, module in sorted(modules.items()) if hasattr(module, "__all__")}


def without_words(page: Any) -> Any:
    """A page of an API, its texts left out; a property may be called `title`, then it is no text."""
    if isinstance(page, dict):
        return {key: without_words(v) for key, v in page.items() if not (key in WORDS and isinstance(v, str))}
    return [without_words(one) for one in page] if isinstance(page, list) else page


def openapi() -> dict[str, Any]:
    """The service's own description of its API."""
    from jshell.service.app import create_app
    from jshell.service.settings import Settings
    from jshell.service.store import Store

    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(db=f"sqlite:///{folder}/jobs.db", warm=False)
        store = Store.open(settings.db, queue=settings.queue)
        try:
            return without_words(create_app(settings, store).openapi())
        finally:
            store.close()


if __name__ == "__main__":
    for name, content in (("names", names()), ("openapi", openapi())):
        text = json.dumps(content, ensure_ascii=False, indent=1, sort_keys=True)
        (HERE / f"{name}.json").write_text(text + "\n", encoding="utf-8")
