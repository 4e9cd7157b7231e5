"""A network that falls silent: a TCP proxy that from some moment on takes everything and passes nothing on."""

import contextlib
import select
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class SilentProxy:
    """Forwards to one address until `silence`; connections stay open all the same, and new ones are accepted."""

    def __init__(self, target: str) -> None:
        host, _, port = target.rpartition(":")
        self._target = (host, int(port))
        self._silent = threading.Event()
        self._stopped = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self._sockets: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def silence(self) -> None:
        """From here on nothing comes through, in either direction."""
        self._silent.set()

    def stop(self) -> None:
        """Closes everything."""
        self._stopped.set()
        for one in [self._listener, *self._sockets]:
            with contextlib.suppress(OSError):
                one.close()

    def _accept(self) -> None:
        while not self._stopped.is_set():
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            self._sockets.append(near)
            if not self._silent.is_set():
                far = socket.create_connection(self._target)
                self._sockets.append(far)
                threading.Thread(target=self._forward, args=(near, far), daemon=True).start()

    def _forward(self, near: socket.socket, far: socket.socket) -> None:
        with contextlib.suppress(OSError, ValueError):
            while not self._stopped.is_set():
                ready, _, _ = select.select([near, far], [], [], 0.05)
                if self._silent.is_set():
                    return
                for one in ready:
                    data = one.recv(1 << 16)
                    if not data:
                        near.close()
                        far.close()
                        return
                    (far if one is near else near).sendall(data)


@contextmanager
def silent_proxy(target: str) -> Iterator[SilentProxy]:
    proxy = SilentProxy(target)
    try:
        yield proxy
    finally:
        proxy.stop()
