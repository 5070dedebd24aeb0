"""A random network that holds everything a record can, and its exports run."""

import pytest
from toy_network import toy_network

from castblast.network import Network
from castblast.network.json_file import to_json


@pytest.fixture(scope="module")
def network() -> Network:
    return toy_network()


@pytest.fixture
def source(network: Network, tmp_path):
    path = tmp_path / "network.json"
    path.write_text(to_json(network))
    return path
