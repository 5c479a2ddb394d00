"""The published DRL-VO network in PyTorch, with any number of channels, as a features extractor of Stable-Baselines3.

Only tests use it. Import it after `pytest.importorskip("stable_baselines3")`.
"""

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

OBSERVATION = 2 * 6400 + 6400 + 2  # velocities, scans, sub-goal


def normed(inputs, outputs, kernel, stride=1, bias=False):
    convolution = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=bias)
    return convolution, nn.BatchNorm2d(outputs)


class Bottleneck(nn.Module):
    def __init__(self, inputs, width, stride=1):
        super().__init__()
        self.conv1, self.bn1 = normed(inputs, width, 1)
        self.conv2, self.bn2 = normed(width, width, 3, stride)
        self.conv3, self.bn3 = normed(width, 2 * width, 1)
        same = inputs == 2 * width and stride == 1
        self.downsample = None if same else nn.Sequential(*normed(inputs, 2 * width, 1, stride))

    def forward(self, x):
        out = torch.relu(self.bn1(self.conv1(x)))
        out = torch.relu(self.bn2(self.conv2(out)))
        return torch.relu(self.bn3(self.conv3(out)) + (self.downsample(x) if self.downsample else x))


class Extractor(BaseFeaturesExtractor):
    def __init__(self, observation_space, channels, features_dim):
        super().__init__(observation_space, features_dim)
        c = channels
        self.conv1, self.bn1 = normed(3, c, 3)
        self.layer1 = nn.Sequential(Bottleneck(c, c), Bottleneck(2 * c, c))
        self.layer2 = nn.Sequential(Bottleneck(2 * c, 2 * c, 2))
        self.layer3 = nn.Sequential(Bottleneck(4 * c, 4 * c, 2))
        self.conv2_2, self.conv3_2 = self.refined(4 * c), self.refined(8 * c)
        self.downsample2 = nn.Sequential(*normed(2 * c, 4 * c, 1, 2, bias=True))
        self.downsample3 = nn.Sequential(*normed(c, 8 * c, 1, 4, bias=True))
        self.linear_fc = nn.Sequential(nn.Linear(8 * c + 2, features_dim), nn.ReLU())

    @staticmethod
    def refined(channels):
        first = *normed(channels, channels // 2, 1, bias=True), nn.ReLU()
        second = *normed(channels // 2, channels // 2, 3, bias=True), nn.ReLU()
        return nn.Sequential(*first, *second, *normed(channels // 2, channels, 1, bias=True))

    def forward(self, observations):
        velocities, scans, goal = torch.split(observations, [12800, 6400, 2], dim=1)
        x = torch.cat((scans.reshape(-1, 1, 80, 80), velocities.reshape(-1, 2, 80, 80)), dim=1)
        stem = nn.functional.max_pool2d(torch.relu(self.bn1(self.conv1(x))), 3, 1, 1)
        first = self.layer1(stem)
        second = torch.relu(self.conv2_2(self.layer2(first)) + self.downsample2(first))
        third = torch.relu(self.conv3_2(self.layer3(second)) + self.downsample3(stem))
        return self.linear_fc(torch.cat((third.mean(dim=(2, 3)), goal), dim=1))


class Spaces(gymnasium.Env):
    """An environment of the authors' observations and actions, which no test steps."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (OBSERVATION,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)


def untrained(channels, features=256, hidden=256, seed=0):
    """A PPO with this network, random weights and random statistics in the norms."""
    torch.manual_seed(seed)
    extractor = {"channels": channels, "features_dim": features}
    ppo = PPO(
        "CnnPolicy",
        Spaces(),
        device="cpu",
        policy_kwargs={
            "features_extractor_class": Extractor,
            "features_extractor_kwargs": extractor,
            "net_arch": {"pi": [hidden], "vf": [128]},
        },
    )
    for module in ppo.policy.modules():
        if isinstance(module, nn.BatchNorm2d):
            for array in (module.weight.data, module.running_var):
                array.uniform_(0.5, 1.5)
            for array in (module.bias.data, module.running_mean):
                array.normal_(0.0, 0.5)
    nn.init.normal_(ppo.policy.action_net.weight, std=1.0 / hidden**0.5)
    nn.init.normal_(ppo.policy.log_std)
    return ppo


def answer(ppo, observation, batch_norm):
    """The means of the action, as Stable-Baselines3 1.1.0 found them ("sample"), or newer ones ("running")."""
    ppo.policy.train(batch_norm == "sample")
    with torch.no_grad():
        given = torch.as_tensor(observation, dtype=torch.float32)[None]
        return ppo.policy.get_distribution(given).distribution.mean[0].numpy()
