"""Train surface normals on views rendered during the training, in new light each epoch. Needs torch."""

import sys
from pathlib import Path

import torch
from torch import nn
from torch.utils.data import DataLoader

import pbrs_farm as pf

SET = """
[render]
recipe = "preview"
[part.views]
homes = {homes}
views = 4
"""


def train(homes: list[str], n_epochs: int = 3) -> None:
    """Train a small network on the stream of a set of homes."""
    Path("out").mkdir(exist_ok=True)
    Path("out/stream.toml").write_text(SET.format(homes=homes))
    stream = pf.stream(
        "out/stream.toml", size=(160, 120), layers=["colour", "normal"], cache="out/stream"
    )
    network = nn.Sequential(
        nn.Conv2d(3, 32, 5, padding=2), nn.ReLU(), nn.Conv2d(32, 32, 5, padding=2), nn.ReLU(),
        nn.Conv2d(32, 3, 5, padding=2),
    )  # fmt: skip
    optimiser = torch.optim.AdamW(network.parameters(), 3e-3)
    for epoch in range(n_epochs):
        losses = []
        for batch in DataLoader(stream.epoch(epoch), batch_size=4, num_workers=1):
            colour = batch["colour"].permute(0, 3, 1, 2).float() / 255 - 0.5
            guess = nn.functional.normalize(network(colour), dim=1)
            cosine = (guess * batch["normal"].permute(0, 3, 1, 2)).sum(1)
            loss = 1 - cosine[batch["valid"]].mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            losses.append(loss.item())
        print(f"epoch {epoch}: loss {sum(losses) / len(losses):.3f}")
    stream.close()


if __name__ == "__main__":  # the workers import this file
    train(sys.argv[1:] or ["builtin"])
