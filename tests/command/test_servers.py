import pytest
from roam_command.reports import UsageError
from roam_command.servers import Addresses, parse_server


def test_one_address_serves_both():
    assert parse_server("localhost:50051") == Addresses("localhost:50051", "localhost:50051")
    assert parse_server("[::1]:7") == Addresses("[::1]:7", "[::1]:7")


def test_two_addresses_come_in_either_order():
    assert parse_server("motion=b:2,goalpose=a:1") == Addresses("a:1", "b:2")


@pytest.mark.parametrize(
    "text", ["", "localhost", ":1", "a:0", "a:99999", "a:b", "goalpose=a:1", "goalpose=a,motion=b:1"]
)
def test_anything_else_is_refused(text: str):
    with pytest.raises(UsageError):
        parse_server(text)


def test_a_web_address_is_told_from_a_grpc_one():
    with pytest.raises(UsageError, match="web address") as raised:
        parse_server("http://127.0.0.1:8080")
    assert "grpc=" in str(raised.value.remedy)
