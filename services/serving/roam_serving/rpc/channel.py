"""Options of the gRPC server's connections.

gRPC takes an option that it does not know without a word, so a test holds every name here against the installed
library. Sources: `grpc/impl/channel_arg_names.h`; the behaviour of grpcio 1.85.1 was measured.
"""

from roam_serving.settings import MIB

SERVER_OPTIONS: tuple[tuple[str, int], ...] = (
    ("grpc.max_receive_message_length", 8 * MIB),  # inline point clouds; uploads come in chunks
    ("grpc.so_reuseport", 0),  # a second server on the same port must fail, not share it
    # A client that vanished without a word is noticed after 20 + 10 s. The second limit decides where a ping is already
    # on its way; left at its default, a frozen client stays for 60 s.
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    ("grpc.http2.ping_timeout_ms", 10_000),
    # Clients and gateways may ask as often as once a second, on idle connections too; by default a connection without
    # calls that pings oftener than every two hours is closed with "too_many_pings".
    ("grpc.http2.min_ping_interval_without_data_ms", 1_000),
    ("grpc.keepalive_permit_without_calls", 1),
    ("grpc.http2.max_ping_strikes", 20),
)
