# SPDX-License-Identifier: GPL-3.0-or-later
"""The signature of the native module in wheels: `python scripts/systems/sign.py WHEEL ... [--timestamp URL]`.

On Linux osslsigncode signs the module of a wheel for Windows; on a Mac codesign signs that of a wheel for macOS, and
Apple's notary checks it. Each wheel is packed again with the new hashes, in place. The certificate and the key of the
notary come from environment variables, see CERTIFICATE and NOTARY. Exit status: 0 signed; 2 failed; 130 stopped.
"""

from __future__ import annotations

import argparse
import base64
import binascii
import json
import os
import re
import secrets
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import environment
import package

from addon.core.base import command
from addon.lab.base.usage import Parser

CERTIFICATE = {
    "HALFSPACE_CERTIFICATE": "the certificate and its key, a PKCS #12 file in base64",
    "HALFSPACE_CERTIFICATE_PASSWORD": "the password of the certificate's file",
}
"""What signing needs: environment variable to its content."""

NOTARY = {
    "HALFSPACE_NOTARY_KEY": "the key for Apple's notary, a .p8 file in base64",
    "HALFSPACE_NOTARY_KEY_ID": "the id of the key for Apple's notary",
    "HALFSPACE_NOTARY_ISSUER": "the issuer of the key for Apple's notary",
}
"""What wheels for macOS need in addition."""

TIMESTAMP = "http://timestamp.digicert.com"
"""The server that states when a module for Windows was signed: the signature outlives its certificate."""


class SignError(RuntimeError):
    """A wheel could not be signed. The message gives the reason in one line, without any secret."""


REPORTED = (SignError, *package.REPORTED)


def run(words: Sequence[str], what: str) -> str:
    """Run a program and return its output. Raises SignError: `what` failed, then the program's last line.

    The words are not part of the message: they may contain passwords.
    """
    if shutil.which(words[0]) is None:
        raise SignError(f"{what}: {words[0]} is not installed")
    done = subprocess.run(list(words), capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    if done.returncode != 0:
        last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
        raise SignError(f"{what} failed: {' '.join(last) or f'status {done.returncode}'}")
    return done.stdout


def given(needed: dict[str, str]) -> list[str]:
    """The values of environment variables. Raises SignError that names the first one that is missing."""
    for name, content in needed.items():
        if not os.environ.get(name):
            raise SignError(f"{name} is not set: it holds {content}")
    return [os.environ[name] for name in needed]


def decoded(text: str, name: str, path: Path) -> Path:
    """Write the file whose content stands in a variable in base64. Returns the path. Raises SignError."""
    try:
        path.write_bytes(base64.b64decode("".join(text.split()), validate=True))
    except binascii.Error as error:
        raise SignError(f"{name} is not base64: {error}") from None
    return path


def packer() -> Path:
    """The Python that has the package `wheel`. Raises environment.SetupError."""
    with environment.alone():
        environment.prepare_packages(environment.PORTABLE)
    return environment.PORTABLE.python


def sign(wheel: Path, timestamp: str) -> None:
    """Sign the native module of a wheel and pack the wheel again, in place. Raises SignError, environment.SetupError.

    timestamp: address of the server of timestamps for Windows; empty for none.
    """
    # Choose by system, and check the variables before any work.
    system = package.platform_of(wheel.name).partition("-")[0]
    if system not in ("windows", "macos"):
        raise SignError(f"{wheel.name}: modules for {system} have no signature")
    certificate, password = given(CERTIFICATE)
    notary = given(NOTARY) if system == "macos" else []
    python = str(packer())
    with tempfile.TemporaryDirectory(prefix="sign-") as name:
        folder = Path(name)
        file = decoded(certificate, next(iter(CERTIFICATE)), folder / "certificate.p12")
        run([python, "-m", "wheel", "unpack", str(wheel), "--dest", str(folder / "content")], f"unpacking {wheel.name}")
        (content,) = (folder / "content").iterdir()
        modules = sorted(path for path in content.rglob("*") if path.suffix in (".pyd", ".so"))
        if len(modules) != 1:
            raise SignError(f"{wheel.name}: expected one native module, found {len(modules)}")
        if system == "windows":
            sign_for_windows(modules[0], file, password, timestamp)
        else:
            sign_for_macos(modules[0], file, password)
            notarise(modules[0], notary, folder)
        # The wheel lists the hash of each file, which signing has changed.
        run([python, "-m", "wheel", "pack", str(content), "--dest-dir", str(folder)], f"packing {wheel.name}")
        packed = folder / wheel.name
        if not packed.is_file():
            raise SignError(f"{wheel.name}: packed under another name")
        shutil.copyfile(packed, wheel)


def sign_for_windows(module: Path, certificate: Path, password: str, timestamp: str) -> None:
    """Sign a module for Windows, on any system. Raises SignError."""
    secret, signed = certificate.with_name("password"), certificate.with_name("signed")
    secret.write_text(password, encoding="utf-8")
    words = ["osslsigncode", "sign", "-pkcs12", str(certificate), "-readpass", str(secret), "-h", "sha256"]
    words += ["-n", "Halfspace", *(["-ts", timestamp] if timestamp else [])]
    run([*words, "-in", str(module), "-out", str(signed)], f"signing {module.name}")
    shutil.copyfile(signed, module)


def sign_for_macos(module: Path, certificate: Path, password: str) -> None:
    """Sign a module for macOS, on a Mac, through a keychain that exists only meanwhile. Raises SignError."""
    keychain, lock, what = str(certificate.with_name("sign.keychain-db")), secrets.token_hex(16), "opening a keychain"
    before = re.findall(r'"(.+)"', run(["security", "list-keychains", "-d", "user"], what))
    run(["security", "create-keychain", "-p", lock, keychain], what)
    try:
        # Let codesign, and nothing else, use the key without a question on the screen.
        run(["security", "unlock-keychain", "-p", lock, keychain], what)
        words = ["security", "import", str(certificate), "-k", keychain, "-f", "pkcs12", "-P", password]
        run([*words, "-T", "/usr/bin/codesign"], "reading the certificate")
        run(["security", "set-key-partition-list", "-S", "apple-tool:,apple:", "-s", "-k", lock, keychain], what)
        run(["security", "list-keychains", "-d", "user", "-s", keychain, *before], what)
        found = run(["security", "find-identity", "-v", "-p", "codesigning", keychain], "looking for the identity")
        identity = re.search(r"\b[0-9A-F]{40}\b", found)
        if identity is None:
            raise SignError("the certificate is not one for signing programs, or it has expired")
        words = ["codesign", "--force", "--options", "runtime", "--timestamp", "--keychain", keychain]
        run([*words, "--sign", identity.group(), str(module)], f"signing {module.name}")
        run(["codesign", "--verify", "--strict", str(module)], f"checking the signature of {module.name}")
    finally:
        run(["security", "delete-keychain", keychain], "removing the keychain")


def notarise(module: Path, key: Sequence[str], folder: Path) -> None:
    """Have Apple's notary accept a signed module. key: the values of NOTARY. Raises SignError."""
    file = decoded(key[0], next(iter(NOTARY)), folder / "notary.p8")
    archive = folder / "module.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as written:
        written.write(module, module.name)
    words = ["xcrun", "notarytool", "submit", str(archive), "--key", str(file), "--key-id", key[1], "--issuer", key[2]]
    answer = run([*words, "--wait", "--output-format", "json"], f"notarising {module.name}")
    # The program ends with 0 also where the notary refuses.
    status = json.loads(answer).get("status")
    if status != "Accepted":
        raise SignError(f"Apple's notary answered {status} for {module.name}")


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="sign", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("wheels", type=Path, nargs="+", help="wheels for Windows or macOS, signed in place")
    parser.add_argument(
        "--timestamp", type=str, default=TIMESTAMP, help=f"server of timestamps, '' for none (default: {TIMESTAMP})"
    )
    return command.run("sign", arguments, parser.parse_args, chosen, told=REPORTED)


def chosen(asked: argparse.Namespace) -> int:
    """Sign the wheels. Returns the exit status."""
    for wheel in asked.wheels:
        sign(wheel, asked.timestamp)
        print(f"signed {wheel}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
