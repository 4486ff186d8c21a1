"""The options of the console override the parameters of their names."""

import os

import pytest
import rospy

from smach_oracle.expert.console.options import make_parser
from smach_oracle.expert.console.server import parameter
from smach_oracle.expert.console.web.settings import read_settings

PARAMETERS = {'~port': 8091, '~bags': '/old:/older'}


@pytest.fixture(autouse=True)
def _parameters(monkeypatch):
    monkeypatch.setattr(rospy, 'get_param', PARAMETERS.get)


def settings(*words):
    options = vars(make_parser().parse_args(words))
    return read_settings(lambda name, default: parameter(options, name, default))


def test_without_options_the_parameters_apply():
    found = settings()
    assert found.port == 8091 and found.bags == ('/old', '/older') and found.stores == ()


def test_options_apply_first():
    found = settings('--port', '0', '--bags', 'new', '--bags', '/newer', '--stores', '/robots.db')
    assert found.port == 0
    assert found.bags == (os.path.abspath('new'), '/newer') and found.stores == ('/robots.db',)
