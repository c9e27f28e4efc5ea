"""Every value of a site's values.yaml is used; the unchanged file equals the base."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

KUBERNETES = Path(__file__).parents[2] / "deploy/kubernetes"


def values_of(site: Path) -> dict[str, Any]:
    """The values of values.yaml without its head."""
    values = yaml.safe_load((site / "values.yaml").read_text())
    return {k: v for k, v in values.items() if k not in ("apiVersion", "kind", "metadata")}


def leaves(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """(path, value) of every leaf of a mapping; `nodes` is one value."""
    if isinstance(value, dict) and path[-1:] != ("nodes",):
        for key, inner in value.items():
            yield from leaves(inner, (*path, key))
    else:
        yield path, value


def test_each_value_is_used_and_each_used_one_exists() -> None:
    component = yaml.safe_load((KUBERNETES / "values/kustomization.yaml").read_text())
    taken = [r["source"]["fieldPath"] for r in component["replacements"]]
    values = leaves(values_of(KUBERNETES / "overlays/site"))
    assert taken == [".".join(path) for path, _value in values]


def rendered(folder: Path) -> dict[tuple[str, str], Any]:
    """(kind, name) -> manifest rendered by kustomize from a folder."""
    if shutil.which("kubectl") is None:
        pytest.skip("no kubectl")
    words = ["kubectl", "kustomize", str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return {(m["kind"], m["metadata"]["name"]): m for m in yaml.safe_load_all(done.stdout)}


@pytest.mark.infra
def test_the_default_values_equal_the_base() -> None:
    base, site = (rendered(KUBERNETES / name) for name in ("base", "overlays/site"))
    nodes = site["Deployment", "worker"]["spec"]["template"]["spec"].pop("nodeSelector")
    assert nodes == {"kubernetes.io/os": "linux"}
    assert site == base


@pytest.mark.infra
def test_other_values_arrive_with_their_types(tmp_path: Path) -> None:
    shutil.copytree(KUBERNETES, tmp_path / "kubernetes")
    site = tmp_path / "kubernetes/overlays/site"
    # With GPU workers, so that their values are used.
    kustomization = site / "kustomization.yaml"
    kustomization.write_text(kustomization.read_text().replace("- ../../base", "- ../gpu"))
    document = yaml.safe_load((site / "values.yaml").read_text())
    expected = []
    for number, (path, value) in enumerate(leaves(values_of(site))):
        inner = document
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = another(value, number)
        expected.append(inner[path[-1]])
    (site / "values.yaml").write_text(yaml.safe_dump(document))
    values = list(everything(rendered(site)))
    assert [value for value in expected if value not in values] == []


def another(value: Any, number: int) -> Any:
    """A unique value of the same type."""
    if isinstance(value, dict):
        return {**value, "pool": f"n{number}"}
    return 70_000 + number if isinstance(value, int) else f"n{number}-{value}"


def everything(value: Any) -> Iterator[Any]:
    """Every value in a tree, mappings and lists included."""
    yield value
    if isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from everything(inner)
