"""The server of a node that ends, as rospy has it."""

import sys
import threading
import xmlrpc.client

import pytest

pytest.importorskip('rospy')

from rosgraph.xmlrpc import ThreadingXMLRPCServer, XmlRpcHandler, XmlRpcNode

from smach_common.node_end import end_quietly
from smach_oracle.ros.command_line import parameters_only


class Handler(XmlRpcHandler):
    def __init__(self):
        self.ready = threading.Event()

    def _ready(self, uri):
        self.ready.set()

    def getPid(self):
        return 42


def test_its_thread_ends_with_it_and_not_before():
    end_quietly()
    handler = Handler()
    node = XmlRpcNode(0, handler)
    thread = threading.Thread(target=node.run, daemon=True)
    thread.start()
    assert handler.ready.wait(10.0)
    with xmlrpc.client.ServerProxy(node.uri) as asked:
        assert [asked.getPid() for _ in range(3)] == [42] * 3
    assert thread.is_alive()
    node.shutdown('the end')
    thread.join(10.0)
    assert not thread.is_alive()


def test_a_node_that_takes_parameters_alone_ends_so(monkeypatch):
    monkeypatch.setattr(sys, 'argv', ['node', '__name:=other'])
    end_quietly()
    ends = ThreadingXMLRPCServer.service_actions
    monkeypatch.delattr(ThreadingXMLRPCServer, 'service_actions')
    parameters_only('A node.')
    assert ThreadingXMLRPCServer.service_actions is ends
