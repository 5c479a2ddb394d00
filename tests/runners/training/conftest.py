"""A browser for the report's page."""

from tests.runners.reports.explainer.conftest import browser, open_page

__all__ = ["browser", "open_page"]
