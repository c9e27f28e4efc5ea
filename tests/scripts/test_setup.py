"""scripts/setup.sh names the packages to install for each system."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "setup.sh"
NEEDED = "libllvm19 libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri redis-server"


def output_of(release: str, tmp_path: Path, words: str, macos: bool = False) -> str:
    """Output of a function of the script on a system with that /etc/os-release."""
    file = tmp_path / "os-release"
    file.write_text(release)
    prologue = "uname() { echo Darwin; }; " if macos else ""
    done = subprocess.run(
        ["bash", "-c", f"source {SCRIPT}; {prologue}{words}"],
        env=os.environ | {"OS_RELEASE": str(file)}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return done.stdout.strip()


@pytest.mark.parametrize(
    ("release", "command"),
    [
        ("ID=debian", "sudo apt-get update && sudo apt-get install -y --no-install-recommends libegl-mesa0"),
        ("ID=ubuntu\nID_LIKE=debian", "libllvm18"),
        ("ID=fedora", "sudo dnf install -y llvm-libs mesa-dri-drivers mesa-libEGL mesa-libGL valkey"),
        ('ID="rocky"\nID_LIKE="rhel centos fedora"', "sudo dnf install -y llvm-libs"),
        ("ID=arch", "sudo pacman -S --needed libglvnd llvm-libs mesa valkey"),
        ("ID=plan9", "no package manager known here"),
    ],
)  # fmt: skip
def test_missing_packages_are_named_as_the_system_names_them(
    release: str, command: str, tmp_path: Path
) -> None:
    assert command in output_of(release, tmp_path, f"command_for {NEEDED}")


def test_on_a_mac_the_brew_packages_are_named(tmp_path: Path) -> None:
    text = output_of("", tmp_path, f"command_for {NEEDED}", macos=True)
    assert text == "brew install llvm redis"
    assert "libegl1" not in output_of("", tmp_path, "missing_packages", macos=True)


def test_llvm_comes_by_pip_if_the_system_has_none(tmp_path: Path) -> None:
    def has(answer: str) -> str:
        return output_of("ID=debian", tmp_path, f"has_lib() {{ {answer}; }}; extras")

    assert has("true").startswith("s3,")
    assert has("false") == f"llvm,{has('true')}"
