import torch
from roam_motion.models.lnsm.config import network_config
from roam_motion.models.lnsm.features import Inputs
from roam_motion.models.lnsm.network import MotionNetwork, Normaliser
from roam_motion.models.lnsm.predict import ChunkedNetwork


def test_a_prediction_is_the_trained_network_between_the_normalisers():
    torch.manual_seed(0)
    config = network_config(22, experts=3, encoding=16, hidden=16)
    network, normaliser = MotionNetwork(config).eval(), Normaliser(config)
    for name, buffer in normaliser.named_buffers():
        buffer.copy_(torch.rand_like(buffer) + (0.5 if name.endswith("std") else 0.0))
    inputs = Inputs(torch.randn(19, config.frame), 9 * torch.randn(19, config.goal), torch.randn(19, config.gating))
    with torch.no_grad():
        parts = [normaliser.apply_to(name, part) for name, part in vars(inputs).items()]
        expected = normaliser.undo("output", network(*parts))
        torch.testing.assert_close(ChunkedNetwork(network, normaliser)(inputs), expected, atol=1e-5, rtol=1e-5)
