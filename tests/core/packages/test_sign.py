# SPDX-License-Identifier: GPL-3.0-or-later
"""Signing wheels: which programs are called, what is reported where something is missing, and the packed wheel."""

from __future__ import annotations

import base64
import hashlib
import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import sign

SECRETS = {
    "HALFSPACE_CERTIFICATE": base64.b64encode(b"certificate").decode(),
    "HALFSPACE_CERTIFICATE_PASSWORD": "pass word",
    "HALFSPACE_NOTARY_KEY": base64.b64encode(b"key").decode(),
    "HALFSPACE_NOTARY_KEY_ID": "KEYID",
    "HALFSPACE_NOTARY_ISSUER": "issuer",
}
IDENTITY = "0123456789ABCDEF0123456789ABCDEF01234567"
ANSWERS = {
    "list-keychains": '    "/Users/me/login.keychain-db"\n',
    "find-identity": f'  1) {IDENTITY} "Developer ID Application: Someone (TEAM)"\n     1 valid identities found\n',
    "notarytool": '{"id": "1", "status": "Accepted"}',
}
"""What Apple's programs print, by one of their words."""

MODULES = {"win_amd64": "halfspace_native.pyd", "macosx_11_0_arm64": "halfspace_native.abi3.so"}


def a_wheel(folder: Path, platform: str, module: bytes = b"module") -> Path:
    """A wheel with a native module."""
    name = f"halfspace_native-0.1.0-cp311-abi3-{platform}"
    info = "halfspace_native-0.1.0.dist-info"
    files = {
        f"halfspace_native/{MODULES.get(platform, 'halfspace_native.abi3.so')}": module,
        "halfspace_native/__init__.py": b"",
        f"{info}/METADATA": b"Metadata-Version: 2.4\nName: halfspace-native\nVersion: 0.1.0\n",
        f"{info}/WHEEL": f"Wheel-Version: 1.0\nRoot-Is-Purelib: false\nTag: cp311-abi3-{platform}\n".encode(),
    }
    record = "".join(f"{file},{digest(content)},{len(content)}\n" for file, content in files.items())
    path = folder / f"{name}.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for file, content in {**files, f"{info}/RECORD": f"{record}{info}/RECORD,,\n".encode()}.items():
            archive.writestr(file, content)
    return path


def digest(content: bytes) -> str:
    return "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()


def module_of(wheel: Path) -> bytes:
    """The module of a wheel, whose record has its hash."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith((".pyd", ".so")))
        content = archive.read(name)
        record = archive.read("halfspace_native-0.1.0.dist-info/RECORD").decode()
    assert f"{name},{digest(content)},{len(content)}" in record.splitlines()
    return content


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The programs that were called, but for the real one that packs; signing appends to the module."""
    called: list[list[str]] = []
    real = subprocess.run

    def run(words: list[str], **named: Any) -> subprocess.CompletedProcess[str]:
        if words[0] == sys.executable:
            return real(words, **named)
        called.append(words)
        if words[0] == "osslsigncode":
            module = Path(words[words.index("-in") + 1]).read_bytes()
            Path(words[words.index("-out") + 1]).write_bytes(module + b" signed")
        if words[:2] == ["codesign", "--force"]:
            Path(words[-1]).write_bytes(Path(words[-1]).read_bytes() + b" signed")
        return subprocess.CompletedProcess(words, 0, next((ANSWERS[word] for word in words if word in ANSWERS), ""), "")

    monkeypatch.setattr(sign.subprocess, "run", run)
    monkeypatch.setattr(sign.shutil, "which", lambda name: name)
    monkeypatch.setattr(sign, "packer", lambda: Path(sys.executable))
    for name, value in SECRETS.items():
        monkeypatch.setenv(name, value)
    return called


def test_a_module_for_windows_is_signed_and_packed_again(ran: list[list[str]], tmp_path: Path) -> None:
    wheel = a_wheel(tmp_path, "win_amd64")
    assert sign.main([str(wheel)]) == 0
    assert module_of(wheel) == b"module signed"
    (words,) = ran
    assert words[:3] == ["osslsigncode", "sign", "-pkcs12"]
    assert words[words.index("-ts") + 1] == sign.TIMESTAMP
    assert words[words.index("-h") + 1] == "sha256"
    assert "pass word" not in words, "other users of the machine see the words of a program"


def test_a_module_for_macos_is_signed_notarised_and_packed_again(ran: list[list[str]], tmp_path: Path) -> None:
    wheel = a_wheel(tmp_path, "macosx_11_0_arm64")
    assert sign.main([str(wheel)]) == 0
    assert module_of(wheel) == b"module signed"
    assert [words[0] if words[0] == "codesign" else words[1] for words in ran] == [
        *("list-keychains", "create-keychain", "unlock-keychain", "import", "set-key-partition-list"),
        *("list-keychains", "find-identity", "codesign", "codesign", "delete-keychain", "notarytool"),
    ]
    assert ran[5][-1] == "/Users/me/login.keychain-db", "the user's keychain stays on the list"
    signing, checking = (words for words in ran if words[0] == "codesign")
    assert {"--timestamp", "runtime", IDENTITY} <= set(signing)
    assert checking[:3] == ["codesign", "--verify", "--strict"]
    assert {"KEYID", "issuer", "--wait"} <= set(ran[-1])


@pytest.mark.parametrize("missing", SECRETS)
def test_without_a_certificate_or_a_key_nothing_is_called(
    ran: list[list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    missing: str,
) -> None:
    monkeypatch.delenv(missing)
    wheel = a_wheel(tmp_path, "macosx_11_0_arm64")
    assert sign.main([str(wheel)]) == 2
    assert not ran
    assert module_of(wheel) == b"module"
    assert capsys.readouterr().err.startswith(f"sign: {missing} is not set: it holds ")


def refuse(word: str, status: int, printed: str) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run as before, but for a program with a word."""
    before = sign.subprocess.run

    def run(words: list[str], **named: Any) -> subprocess.CompletedProcess[str]:
        done = before(words, **named)
        return subprocess.CompletedProcess(words, status, printed, "") if word in words else done

    return run


@pytest.mark.parametrize(
    ("refused", "line"),
    [
        (("find-identity", 0, "     0 valid identities found\n"), "the certificate is not one for signing programs"),
        (("import", 1, "first\nMAC verification failed\n"), "reading the certificate failed: MAC verification failed"),
        (("--strict", 3, ""), "checking the signature of halfspace_native.abi3.so failed: status 3"),
        (("notarytool", 0, '{"status": "Invalid"}'), "Apple's notary answered Invalid for halfspace_native.abi3.so"),
    ],
)
def test_what_apple_refuses_is_one_line_and_the_wheel_stays(
    ran: list[list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    refused: tuple[str, int, str],
    line: str,
) -> None:
    monkeypatch.setattr(sign.subprocess, "run", refuse(*refused))
    wheel = a_wheel(tmp_path, "macosx_11_0_arm64")
    assert sign.main([str(wheel)]) == 2
    assert module_of(wheel) == b"module"
    said = capsys.readouterr().err
    assert said.startswith(f"sign: {line}")
    assert said.count("\n") == 1
    assert "delete-keychain" in [words[1] for words in ran], "the keychain goes in any case"


@pytest.mark.parametrize(
    ("certificate", "platform", "line"),
    [
        ("?", "win_amd64", "HALFSPACE_CERTIFICATE is not base64"),
        ("", "win_amd64", "HALFSPACE_CERTIFICATE is not set"),
        ("", "linux_x86_64", "halfspace_native-0.1.0-cp311-abi3-linux_x86_64.whl: modules for linux have no signature"),
    ],
)
def test_what_cannot_be_signed_is_one_line(
    ran: list[list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    certificate: str,
    platform: str,
    line: str,
) -> None:
    monkeypatch.setenv("HALFSPACE_CERTIFICATE", certificate)
    assert sign.main([str(a_wheel(tmp_path, platform))]) == 2
    assert not ran
    assert capsys.readouterr().err.startswith(f"sign: {line}")


def test_a_missing_program_is_one_line(
    ran: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sign.shutil, "which", lambda name: None if name == "osslsigncode" else name)
    assert sign.main([str(a_wheel(tmp_path, "win_amd64"))]) == 2
    assert capsys.readouterr().err == "sign: signing halfspace_native.pyd: osslsigncode is not installed\n"


def a_library() -> bytes:
    """The smallest file that is a library for Windows: headers and one section."""
    headers = b"MZ" + bytes(58) + struct.pack("<I", 64)
    headers += b"PE\0\0" + struct.pack("<HHIIIHH", 0x8664, 1, 0, 0, 0, 240, 0x2022)
    # The optional header: magic, code, base, alignments, versions, sizes of image and headers, directories.
    headers += struct.pack("<HBBIIIII", 0x20B, 14, 0, 512, 0, 0, 0x1000, 0x1000)
    headers += struct.pack("<QIIHHHHHHIIIIHH", 0x180000000, 0x1000, 512, 6, 0, 0, 0, 6, 0, 0, 0x2000, 512, 0, 2, 0)
    headers += struct.pack("<QQQQII", 0x100000, 0x1000, 0x100000, 0x1000, 0, 16) + bytes(128)
    headers += b".text\0\0\0" + struct.pack("<IIIIIIHHI", 512, 0x1000, 512, 512, 0, 0, 0, 0, 0x60000020)
    return headers.ljust(512, b"\0") + b"\xc3".ljust(512, b"\0")


@pytest.mark.skipif(
    shutil.which("osslsigncode") is None or shutil.which("openssl") is None,
    reason="osslsigncode and openssl are not installed",
)
def test_a_real_signature_verifies_against_its_certificate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    certificate, key, both = (tmp_path / name for name in ("certificate.pem", "key.pem", "both.p12"))
    for words in (
        [
            *("req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=Nobody", "-days", "2"),
            *("-keyout", str(key), "-out", str(certificate), "-addext", "extendedKeyUsage=codeSigning"),
        ],
        ["pkcs12", "-export", "-inkey", str(key), "-in", str(certificate), "-out", str(both), "-passout", "pass:a b"],
    ):
        subprocess.run(["openssl", *words], check=True, capture_output=True)
    monkeypatch.setenv("HALFSPACE_CERTIFICATE", base64.encodebytes(both.read_bytes()).decode())
    monkeypatch.setenv("HALFSPACE_CERTIFICATE_PASSWORD", "a b")
    monkeypatch.setattr(sign, "packer", lambda: Path(sys.executable))
    wheel = a_wheel(tmp_path, "win_amd64", a_library())
    assert sign.main([str(wheel), "--timestamp", ""]) == 0
    signed = tmp_path / "signed.pyd"

    def verifies(content: bytes) -> bool:
        signed.write_bytes(content)
        words = ["osslsigncode", "verify", "-CAfile", str(certificate), "-in", str(signed)]
        return subprocess.run(words, capture_output=True, check=False).returncode == 0

    content = module_of(wheel)
    assert verifies(content)
    assert not verifies(a_library())
    # One other bit of the code is noticed.
    assert not verifies(content[:512] + bytes([content[512] ^ 1]) + content[513:])
