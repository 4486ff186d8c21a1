"""A line between a browser and a server that can be held up, or cut."""

import contextlib
import socket
import struct
import threading

from smach_oracle.experiment.launching import free_port

_RESET = struct.pack('ii', 1, 0)  # SO_LINGER: what is closed is reset


class ThinLine:
    """Listens on `port` and passes on what comes to the server's port, and back."""

    def __init__(self, server_port):
        self.port = free_port()
        self._server_port = server_port
        self._open = threading.Event()
        self._open.set()
        self._ends = set()
        self._listener = socket.create_server(('127.0.0.1', self.port))
        threading.Thread(target=self._accept, daemon=True).start()

    @contextlib.contextmanager
    def held_up(self):
        """Nothing gets through meanwhile, and nobody is told."""
        self._open.clear()
        try:
            yield
        finally:
            self._open.set()

    def cut(self):
        """All connections are reset; new ones may come."""
        for end in list(self._ends):
            self._close(end)

    def close(self):
        """For good."""
        self._listener.close()
        self._open.set()
        self.cut()

    def _accept(self):
        while True:
            try:
                page, _ = self._listener.accept()
                server = socket.create_connection(('127.0.0.1', self._server_port))
            except OSError:
                if self._listener.fileno() < 0:
                    return
                page.close()  # the server is not there
                continue
            self._ends |= {page, server}
            for end in (page, server):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for way in ((page, server), (server, page)):
                threading.Thread(target=self._pass_on, args=way, daemon=True).start()

    def _pass_on(self, source, sink):
        with contextlib.suppress(OSError):
            while True:
                data = source.recv(65536)
                self._open.wait()
                if not data:
                    break
                sink.sendall(data)
        self._close(source)
        self._close(sink)

    def _close(self, end):
        self._ends.discard(end)
        with contextlib.suppress(OSError):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
            end.shutdown(socket.SHUT_RDWR)
        end.close()
