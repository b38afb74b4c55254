"""One small campaign, run once undisturbed; what others do to it is compared with this."""

from pathlib import Path

import pytest

from jshell import campaigns

SMALL = campaigns.Design(
    "four shells",
    (
        campaigns.Family(
            "gas",
            "modes",
            {"d_hat": 0.22, "load": 1.05, "eta_hat": 0.004, "elements": 16, "weak_depth": 0.0},
            {"P0_hat": (0.6, 0.9, 1.5)},
        ),
        campaigns.Family("none", "modes", {"d_hat": 0.22, "P0_hat": 0.9, "excess": 0.1, "elements": 16}),
    ),
)


@pytest.fixture(scope="session")
def small() -> campaigns.Design:
    """Three gases, and a load at which nothing buckles."""
    return SMALL


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory) -> Path:
    """The folder of the small campaign, run in this process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    campaigns.run(SMALL, folder)
    return folder


@pytest.fixture(scope="session")
def shipped() -> campaigns.Catalog:
    """The campaign that comes with the package."""
    return campaigns.catalog()
