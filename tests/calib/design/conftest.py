"""Selections without their certificate, for tests that look at the sets alone."""

import pytest


@pytest.fixture
def uncertified(monkeypatch):
    """Nothing is proven of a set: that takes most of a small search, and has tests of its own."""
    monkeypatch.setattr("calib.design.selection.certificate_of", lambda *_: None)
