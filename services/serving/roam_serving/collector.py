"""Python's cycle collector in a process that must not stop."""

import gc


def spare_collector() -> None:
    """Python's cycle collector passes over what is loaded, and looks at the rest seldom.

    With 64 streams it would stop the event loop twice a second, for up to 20 ms.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 50, 20)
