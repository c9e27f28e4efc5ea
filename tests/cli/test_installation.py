"""The remedy fits the installation and the system."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from pbrs_farm import doctor, installation
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.installation import (
    EXTRA_OF,
    checkout_folder,
    install_command,
    need,
    pip_command,
    system_command,
    this_system,
)

REPO = Path(__file__).parents[2]


def test_every_extra_named_is_one_of_pyproject() -> None:
    extras = tomllib.loads((REPO / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    assert set(EXTRA_OF.values()) <= {*extras, ""}
    # `all` is every extra for users, without those for developers, benches and studies.
    of_all = extras["all"][0].partition("[")[2].strip("]").split(",")
    assert set(of_all) == set(extras) - {
        "all", "bench", "dev", "docs", "imagenet", "notebooks", "release", "study", "study-peers", "tensorboard", "wandb",
    }  # fmt: skip


def test_the_contribution_of_every_extra_of_all_is_listed() -> None:
    extras = tomllib.loads((REPO / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    assert set(installation.GIVES) == set(extras["all"][0].partition("[")[2].strip("]").split(","))


def test_missing_extras_are_named_with_their_features(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "missing_extras", lambda: ["video", "usd"])
    monkeypatch.setattr(doctor, "install_command", lambda *names: f"pip install {','.join(names)}")
    finding = doctor.optional_extras()
    assert (finding.state, finding.remedy) == ("absent", "pip install video,usd")
    assert "video: films of walks; usd: homes from and to USD" in finding.text
    assert doctor.can_run([finding])
    monkeypatch.setattr(installation, "is_installed", lambda name: name != "av")
    assert installation.missing_extras() == ["video"]


@pytest.mark.parametrize(
    ("has_torch", "text"), [(True, "all"), (False, "all but study, which trains networks: pip it")]
)
def test_where_only_the_large_extra_is_missing_doctor_names_it_and_all_is_well(
    has_torch: bool, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "missing_extras", list)
    monkeypatch.setattr(doctor, "is_installed", lambda name: has_torch or name != "torch")
    monkeypatch.setattr(doctor, "install_command", lambda *_: "pip it")
    assert doctor.optional_extras() == doctor.Finding("extras", "ok", text)


@pytest.mark.parametrize(
    ("system", "machine", "command"),
    [
        ("linux", "x86_64", "pip install 'pbrs-farm[llvm]'"),
        ("linux", "aarch64", "sudo apt-get install -y libllvm19"),
        ("darwin", "arm64", "brew install llvm"),
    ],
)
def test_llvm_comes_by_pip_if_it_has_a_wheel(
    system: str, machine: str, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.platform", system)
    monkeypatch.setattr("platform.machine", lambda: machine)
    monkeypatch.setattr(installation, "checkout_folder", lambda: None)
    monkeypatch.setattr(installation, "pip_command", lambda: "pip")
    monkeypatch.setattr(
        installation, "this_system", lambda: "macos" if system == "darwin" else "debian"
    )
    assert installation.llvm_command() == command


def test_a_checkout_and_a_wheel_are_distinguished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert checkout_folder() == REPO
    assert checkout_folder(tmp_path / "site-packages" / "pbrs_farm") is None
    monkeypatch.setattr(installation, "pip_command", lambda: "pip")
    assert install_command("s3", "video") == f"pip install -e '{REPO}[s3,video]'"
    monkeypatch.setattr(installation, "checkout_folder", lambda: None)
    assert install_command("s3") == "pip install 'pbrs-farm[s3]'"
    assert install_command() == "pip install --force-reinstall 'pbrs-farm'"


def test_pip_is_suggested_only_if_it_is_this_pythons(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside = str(Path(sys.executable).parent)
    pip = tmp_path / "pip"
    pip.write_text("#!/bin/sh\n")
    pip.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert pip_command() == f"{sys.executable} -m pip"
    monkeypatch.setattr("shutil.which", lambda _name: f"{beside}/pip")
    assert pip_command() == "pip"


def test_every_hint_to_install_comes_from_one_module() -> None:
    for folder in ("pbrs_farm", "workers"):
        for path in (REPO / folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            assert path.name == "installation.py" or "pip install" not in text, path


@pytest.mark.parametrize(
    ("release", "system", "command"),
    [
        ('ID=debian\nVERSION_ID="12"', "debian", "sudo apt-get install -y libllvm19"),
        ("ID=ubuntu\nID_LIKE=debian", "ubuntu", "sudo apt-get install -y libllvm18"),
        ("ID=fedora", "fedora", "sudo dnf install -y llvm-libs"),
        ('ID="rocky"\nID_LIKE="rhel centos fedora"', "fedora", "sudo dnf install -y llvm-libs"),
        ("ID=manjaro\nID_LIKE=arch", "arch", "sudo pacman -S --needed llvm-libs"),
        ("ID=plan9", "", "install LLVM 17 or later (its shared library)"),
    ],
)
def test_each_system_has_its_install_command(
    release: str, system: str, command: str, tmp_path: Path
) -> None:
    file = tmp_path / "os-release"
    file.write_text(release)
    assert this_system(file) == system
    assert system_command("llvm", system or "none") == command


def test_a_missing_dependency_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    need("numpy")
    monkeypatch.setattr(installation, "is_installed", lambda name: name == "drjit")
    with pytest.raises(MachineFailed, match=r"this needs mitsuba, av \(.*pip install.*\[video\]"):
        need("mitsuba", "drjit", "av")


@pytest.mark.quick(1)
@pytest.mark.parametrize("words", ["run builtin --out x", "cameras builtin", "verify x", "layers"])
def test_a_broken_installation_is_reported_in_one_line_by_the_verb(
    words: str, tmp_path: Path
) -> None:
    # Hide the packages from the imports of a separate process.
    code = (
        "import sys\n"
        "hidden = {'mitsuba', 'drjit', 'pyoidn', 'moderngl'}\n"
        "class Hide:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name.split('.')[0] in hidden: raise ModuleNotFoundError(name, name=name)\n"
        "sys.meta_path.insert(0, Hide())\n"
        "from pbrs_farm import installation\n"
        "installation.is_installed = lambda name: name not in hidden\n"
        f"from pbrs_farm.cli import main; sys.exit(main({words.split()!r}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert "Traceback" not in done.stderr
    if words in ("run builtin --out x", "cameras builtin"):
        assert done.returncode == 1
        assert len(done.stderr.splitlines()) == 1
        assert "this needs mitsuba" in done.stderr or "Mitsuba cannot be" in done.stderr
        assert "pip install" in done.stderr
