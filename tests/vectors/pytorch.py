"""Makes the vectors that the networks are tested against.

Run `python3 tests/vectors/pytorch.py` with PyTorch 2.11 installed.

The networks are built here from the paper's description and from docs alone. Weights and inputs are sines, so
that the tests can make the same ones and only outputs need be stored.

Imported, it only defines the networks that the shipped weights fit: `CnnLearned` (cnn-learned), `MetricLearned`
(mgm-learned and mlr-learned) and `Belief` (parfocal). The paper's three take focal powers f in 0..1 as
2 (f - 0.5); `scaled_focal_powers` does that.
"""

import json
import math
import pathlib

import torch
from torch import nn

HERE = pathlib.Path(__file__).parent


def wave(count, rate, scale, offset=0.0):
    return torch.tensor([offset + scale * math.sin(rate * index) for index in range(count)], dtype=torch.float32)


def fill(module):
    """Every parameter, in the order of their names: its k-th gets 0.2 sin((0.37 + 0.01 k) i)."""
    for k, (_, parameter) in enumerate(sorted(module.named_parameters())):
        parameter.data = wave(parameter.numel(), 0.37 + 0.01 * k, 0.2).view(parameter.shape)


def scaled_focal_powers(focal_powers):
    """Focal powers 0..1 as `CnnLearned` and `MetricLearned` take them."""
    return 2 * (focal_powers - 0.5)


def scaled_mgm(metrics):
    """Mean gradient magnitudes as `MetricLearned` takes them."""
    return (metrics + 0.5).log() - 3.5


def scaled_mlr(metrics):
    """Mean local ratios as `MetricLearned` takes them."""
    return 0.5 * ((metrics - 1).clamp(min=0) + 1e-4).log() + 1.75


def head(inputs):
    return nn.Sequential(nn.Linear(inputs, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, 3))


class CnnLearned(nn.Module):
    """Patches `[8, 1024]` (0..255) and scaled focal powers `[8]`, oldest first, to the values `[1, 3]` of down, none, up."""

    def __init__(self):
        super().__init__()
        layers = [nn.Conv2d(1, 8, 3, 2)]
        for _ in range(3):
            layers += [nn.ReLU(), nn.Conv2d(8, 8, 3, 2)]
        self.encoder = nn.Sequential(*layers)
        self.head = head(8 * (8 + 1))

    def encode(self, patches):
        centred = patches - patches.mean(1, keepdim=True)
        spread = centred.square().mean(1, keepdim=True).sqrt() + 2
        return self.encoder((centred / spread).view(-1, 1, 32, 32)).flatten(1)

    def forward(self, patches, focal_powers):
        return self.head(torch.cat([self.encode(patches).flatten()[None], focal_powers[None]], 1))


class MetricLearned(nn.Module):
    """Scaled metrics `[8]` and scaled focal powers `[8]`, oldest first, to the values `[1, 3]` of down, none, up."""

    def __init__(self):
        super().__init__()
        self.head = head(8 * (1 + 1))

    def forward(self, metrics, focal_powers):
        return self.head(torch.cat([metrics[None], focal_powers[None]], 1))


class Belief(nn.Module):
    """Inputs `[N, T, 295]`, as `server/autofocus/src/belief.rs` makes them of frames, to logits `[N, T, 41]` of the
    optimum's bins.
    """

    def __init__(self, inputs, units, bins):
        super().__init__()
        self.memory = nn.GRU(inputs, units, batch_first=True)
        self.head_0 = nn.Linear(units, units)
        self.head_2 = nn.Linear(units, bins)

    def forward(self, inputs):
        return self.head_2(self.head_0(self.memory(inputs)[0]).relu())


class SteepestFrame(nn.Module):
    """A policy for the tests: goes up where the latest patch is steeper than the one before, else down."""

    def forward(self, patches: torch.Tensor, focal_powers: torch.Tensor) -> torch.Tensor:
        steep = (patches[:, :, 1:] - patches[:, :, :-1]).abs().mean(dim=(1, 2))
        gain = steep[-1] - steep[-2]
        return torch.stack([-gain, torch.zeros_like(gain), gain])


class WrongShape(nn.Module):
    def forward(self, patches: torch.Tensor, focal_powers: torch.Tensor) -> torch.Tensor:
        return focal_powers


@torch.no_grad()
def main():
    cnn = CnnLearned()
    fill(cnn)
    patches = wave(8 * 1024, 0.113, 100.0, 128.0).view(8, 1024)
    values = cnn(patches, wave(8, 0.7, 1.0))
    # Fewer inputs than the shipped network has: it is the same for any number.
    inputs, units, bins = 177, 320, 41
    belief = Belief(inputs, units, bins)
    fill(belief)
    logits = belief(wave(2 * 5 * inputs, 0.29, 1.0).view(2, 5, inputs))
    vectors = {
        "made_with": f"PyTorch {torch.__version__}",
        "cnn_encodings": cnn.encode(patches).flatten().tolist(),
        "cnn_values": values.flatten().tolist(),
        "belief_logits": logits[:, -1].flatten().tolist(),
    }
    (HERE / "pytorch.json").write_text(json.dumps(vectors, indent=1) + "\n")
    torch.jit.script(SteepestFrame()).save(str(HERE / "steepest-frame.pt"))
    torch.jit.script(WrongShape()).save(str(HERE / "wrong-shape.pt"))


if __name__ == "__main__":
    main()
