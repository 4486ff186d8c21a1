"""Borders are tried without a word from SMACH or ROS."""

import logging

import pytest

import smach


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    for name in ('loginfo', 'logwarn', 'logdebug', 'logerr'):
        monkeypatch.setattr(smach, name, lambda text: None)
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)
