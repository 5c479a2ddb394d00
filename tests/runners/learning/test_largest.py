"""The largest outputs and their gradients against torch's own."""

import pytest

from tests.tolerances import FLOAT32_LAYER

torch = pytest.importorskip("torch")

from runners.learning.largest import largest_output  # noqa: E402


@pytest.mark.parametrize("shape", [(1, 1, 3, 2), (7, 90, 64, 128), (4, 5, 6, 1)])
def test_largest_outputs_and_gradients_are_those_of_torch(shape):
    scenes, rows, inputs, outputs = shape
    generator = torch.Generator().manual_seed(0)
    features = torch.randn((scenes, rows, inputs), generator=generator, requires_grad=True)
    weight = torch.randn((outputs, inputs), generator=generator, requires_grad=True)
    slopes = torch.randn((scenes, outputs), generator=generator)
    wanted = (features @ weight.T).amax(1)
    found = largest_output(features, weight)
    torch.testing.assert_close(found, wanted, atol=FLOAT32_LAYER, rtol=0.0)
    parts = [features, weight]
    pairs = zip(
        torch.autograd.grad(found, parts, slopes), torch.autograd.grad(wanted, parts, slopes), strict=True
    )
    for one, other in pairs:
        torch.testing.assert_close(one, other, atol=10 * FLOAT32_LAYER, rtol=0.0)


def test_of_equal_outputs_the_first_has_the_gradient():
    features = torch.ones((1, 3, 2), requires_grad=True)
    (gradient,) = torch.autograd.grad(largest_output(features, torch.ones((1, 2))).sum(), [features])
    assert gradient[0].tolist() == [[1.0, 1.0], [0.0, 0.0], [0.0, 0.0]]
