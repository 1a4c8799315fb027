"""Makes the vectors that the networks are tested against: run `python3 tests/vectors/pytorch.py` with PyTorch 2.11 installed.

The networks are built here from the paper's description and from docs alone. Weights and inputs are sines, so that the
tests can make the same ones and only outputs need be stored.
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


class CnnLearned(nn.Module):
    def __init__(self):
        super().__init__()
        layers = [nn.Conv2d(1, 8, 3, 2)]
        for _ in range(3):
            layers += [nn.ReLU(), nn.Conv2d(8, 8, 3, 2)]
        self.encoder = nn.Sequential(*layers)
        self.head = nn.Sequential(nn.Linear(72, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, 3))

    def encode(self, patches):
        centred = patches - patches.mean(1, keepdim=True)
        spread = centred.square().mean(1, keepdim=True).sqrt() + 2
        return self.encoder((centred / spread).view(-1, 1, 32, 32)).flatten(1)

    def forward(self, patches, focal_powers):
        return self.head(torch.cat([self.encode(patches).flatten()[None], focal_powers[None]], 1))


class Belief(nn.Module):
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


with torch.no_grad():
    cnn = CnnLearned()
    fill(cnn)
    patches = wave(8 * 1024, 0.113, 100.0, 128.0).view(8, 1024)
    values = cnn(patches, wave(8, 0.7, 1.0))
    inputs, units, bins = 87, 192, 41
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
