"""The paper's deep Q-learning update in PyTorch, eager, one thread: what `cargo bench --bench training` is compared with.

Transitions drawn at random from a replay memory of patches as bytes, each a state of eight frames and its successor;
smooth L1, RMSProp, target network by moving average. Budd et al., MICCAI 2023.
"""

import time

import torch
from torch import nn

torch.set_num_threads(1)
torch.manual_seed(1)
FRAMES, HISTORY = 20_000, 8


def head(inputs):
    return nn.Sequential(nn.Linear(inputs, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, 3))


class Scalar(nn.Module):
    def __init__(self):
        super().__init__()
        self.head = head(2 * HISTORY)

    def forward(self, seen, focal_powers):
        return self.head(torch.cat([seen.flatten(1), focal_powers], 1))


class Cnn(nn.Module):
    def __init__(self):
        super().__init__()
        layers = [nn.Conv2d(1, 8, 3, 2)]
        for _ in range(3):
            layers += [nn.ReLU(), nn.Conv2d(8, 8, 3, 2)]
        self.encoder = nn.Sequential(*layers)
        self.head = head(9 * HISTORY)

    def forward(self, seen, focal_powers):
        patches = seen.float().view(-1, 1024)
        centred = patches - patches.mean(1, keepdim=True)
        scaled = centred / (centred.square().mean(1, keepdim=True).sqrt() + 2)
        encodings = self.encoder(scaled.view(-1, 1, 32, 32)).view(seen.shape[0], -1)
        return self.head(torch.cat([encodings, focal_powers], 1))


def measure(name, make, seen, batch, times):
    online, target = make(), make()
    target.load_state_dict(online.state_dict())
    optimiser = torch.optim.RMSprop(online.parameters(), lr=1e-5, momentum=0.95)
    focal_powers, rewards = torch.rand(FRAMES), -torch.rand(FRAMES)
    actions = torch.randint(3, (FRAMES,))
    back = torch.arange(HISTORY) - HISTORY + 1

    def update():
        at = torch.randint(HISTORY, FRAMES - 1, (batch,))
        now, after = at[:, None] + back, at[:, None] + back + 1
        with torch.no_grad():
            best = target(seen[after], focal_powers[after]).max(1).values
            wanted = rewards[at] + 0.99 * best
        chosen = online(seen[now], focal_powers[now]).gather(1, actions[at][:, None])[:, 0]
        loss = nn.functional.smooth_l1_loss(chosen, wanted)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        with torch.no_grad():
            for slow, fast in zip(target.parameters(), online.parameters()):
                slow.lerp_(fast, 0.005)
        return loss.item()

    for _ in range(times // 10 + 1):
        update()
    begin = time.perf_counter()
    for _ in range(times):
        update()
    rate = times / (time.perf_counter() - begin)
    print(f"peer {name}, {batch} transitions: {rate:.1f} updates a second, {rate * batch:.0f} transitions", flush=True)


for size in [32, 256]:
    measure("mgm-learned-paper", Scalar, torch.rand(FRAMES), size, 300)
    measure("cnn-learned-paper", Cnn, torch.randint(256, (FRAMES, 1024), dtype=torch.uint8), size, 20)
