#!/usr/bin/env python3
"""Checks the crates of the workspace and the fuzz targets; writes their table in docs/internals/dependencies.md.

    tools/dependencies.py               fails if the table is out of date, a license is not in deny.toml's list,
                                        a crate does not come from the registry or requires a newer Rust than
                                        rust-version, README.md or fuzz/ state another version, or a member of
                                        the workspace depends on what its layer excludes
    tools/dependencies.py --write       writes the table
    tools/dependencies.py --advisories  asks cargo-audit or cargo-deny, where one of them is installed

The source is `cargo metadata` of both lock files.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import options

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs" / "internals" / "dependencies.md"
BEGIN, END = "<!-- crates -->\n", "<!-- /crates -->\n"
PLATFORMS = ("x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu")
TERMINAL = {"clap", "comfy-table", "ctrlc", "indicatif", "tracing-subscriber"}
FILES_AND_NETWORK = TERMINAL | {"mcap", "rustdds", "ros2-client", "tokio"}
LAYERS: dict[str, set[str]] = {
    "virtual_axes_core": FILES_AND_NETWORK | {"cdr-encoding", "quick-xml", "serde_json"},
    "virtual_axes_identify": FILES_AND_NETWORK | {"cdr-encoding", "quick-xml"},
    "virtual_axes_nc": FILES_AND_NETWORK | {"cdr-encoding", "quick-xml", "serde_json"},
    "virtual_axes_c": FILES_AND_NETWORK | {"cdr-encoding", "quick-xml", "serde_json"},
    "virtual_axes_fmu": FILES_AND_NETWORK | {"cdr-encoding", "quick-xml", "serde_json"},
    "virtual_axes_io": FILES_AND_NETWORK - {"mcap"},
    "virtual_axes_report": FILES_AND_NETWORK,
    "virtual_axes_py": FILES_AND_NETWORK - {"mcap"},
}
"""Crates that a member of the workspace must not depend on, directly or through others."""
REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"
PROGRAMS, SECURITY, TESTS, FUZZ = "programs", "feature security", "tests and benchmarks", "fuzz targets"


class Row(NamedTuple):
    """Crate with its license, what needs it, its source and the Rust version that it requires."""

    name: str
    version: str
    license: str
    what: str
    source: str | None
    rust: str | None


def metadata(manifest: Path, *features: str) -> dict[str, Any]:
    """Returns cargo's metadata of a package by its lock file, for all platforms together."""
    words = ["cargo", "metadata", "--locked", "--format-version", "1"]
    words += [word for platform in PLATFORMS for word in ("--filter-platform", platform)]
    done = subprocess.run([*words, "--manifest-path", manifest, *features], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"dependencies: {done.stderr.strip()}")
    return json.loads(done.stdout)


def reached(known: dict[str, Any], with_tests: bool) -> set[str]:
    """Returns the ids of packages that the programs depend on; with tests, all members of the workspace."""
    nodes = {node["id"]: node for node in known["resolve"]["nodes"]}
    found, left = set(), list(known["workspace_members"] if with_tests else [known["resolve"]["root"]])
    while left:
        package = left.pop()
        if package in found:
            continue
        found.add(package)
        for dependency in nodes[package]["deps"]:
            kinds = {kind["kind"] for kind in dependency["dep_kinds"]}
            if with_tests or kinds != {"dev"}:
                left.append(dependency["pkg"])
    return found


def is_allowed(expression: str, allowed: set[str]) -> bool:
    """Returns true if licenses of the list satisfy an SPDX expression."""
    expression = re.sub(r"\s+WITH\s+[\w.-]+", "", expression.replace("/", " OR "))
    known = {"OR": "or", "AND": "and"}
    words = re.sub(r"[\w.+-]+", lambda word: known.get(word[0], str(word[0] in allowed)), expression)
    if not re.fullmatch(r"(True|False|or|and|[()\s])+", words):
        return False
    try:
        return bool(eval(words, {"__builtins__": {}}))  # nothing but the words above is in it
    except SyntaxError:
        return False


def clarified(rules: dict[str, Any], package: dict[str, Any]) -> str:
    """Returns the license of a package from its manifest or from the clarifications in deny.toml."""
    clarified_licenses = {rule["crate"]: rule["expression"] for rule in rules.get("clarify", [])}
    return package["license"] or clarified_licenses.get(package["name"], "not stated")


def version(text: str | None) -> tuple[int, ...]:
    """Returns a Rust version as numbers, major and minor; none is the oldest."""
    return tuple(int(part) for part in (text or "0.0").split(".")[:2])


def newest_rust(rows: list[Row]) -> tuple[str, list[str]]:
    """Returns the newest Rust version that crates require, and these crates."""
    newest = max(version(row.rust) for row in rows)
    names = [f"{row.name} {row.version}" for row in rows if version(row.rust) == newest]
    return ".".join(map(str, newest)), names


def rust_faults(rust: str, names: list[str]) -> list[str]:
    """Returns contradictions of rust-version in Cargo.toml: newer crates, other versions in fuzz/ and README.md."""
    stated = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["rust-version"]
    of_fuzz = tomllib.loads((ROOT / "fuzz" / "Cargo.toml").read_text())["package"]["rust-version"]
    faults = []
    if version(rust) > version(stated):
        faults.append(f"rust-version in Cargo.toml is {stated}, {names[0]} requires {rust}")
    if of_fuzz != stated:
        faults.append(f"rust-version in fuzz/Cargo.toml is {of_fuzz}, expected {stated}")
    if f"Rust {stated} or newer" not in " ".join((ROOT / "README.md").read_text().split()):
        faults.append(f"README.md does not contain: Rust {stated} or newer")
    return faults


def crates(rules: dict[str, Any]) -> list[Row]:
    """Returns the crates, sorted by name."""
    own = ROOT / "Cargo.toml"
    default, secured, fuzz = metadata(own), metadata(own, "--all-features"), metadata(ROOT / "fuzz" / "Cargo.toml")
    where: dict[tuple[str, str], str] = {}
    packages: dict[tuple[str, str], dict[str, Any]] = {}
    for known, with_tests, what in (
        (default, False, PROGRAMS),
        (secured, False, SECURITY),
        (secured, True, TESTS),
        (fuzz, True, FUZZ),
    ):
        needed = reached(known, with_tests)
        for package in known["packages"]:
            is_own = package["source"] is None and ROOT in Path(package["manifest_path"]).parents
            if package["id"] in needed and not is_own:
                key = package["name"], package["version"]
                where.setdefault(key, what)
                packages[key] = package
    rows = []
    for key in sorted(packages):
        package = packages[key]
        rows.append(Row(*key, clarified(rules, package), where[key], package["source"], package["rust_version"]))
    return rows


def layer_faults() -> list[str]:
    """Returns the dependencies of members of the workspace that their layers exclude."""
    faults = []
    for member, excluded in LAYERS.items():
        words = ["cargo", "tree", "--locked", "-p", member, "-e", "normal", "--prefix", "none", "--format", "{p}"]
        tree = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
        if tree.returncode:
            raise SystemExit(f"dependencies: {tree.stderr.strip()}")
        needed = {line.split()[0] for line in tree.stdout.splitlines()}
        faults += [f"{member} depends on {name}" for name in sorted(needed & excluded)]
    return faults


def advisories() -> int:
    """Runs cargo-audit or cargo-deny and returns its status."""
    for program, words in (("cargo-audit", ["audit"]), ("cargo-deny", ["deny", "check"])):
        if shutil.which(program):
            return subprocess.run(["cargo", *words], cwd=ROOT).returncode
    print("dependencies: needs cargo-audit or cargo-deny, and RustSec's database", file=sys.stderr)
    return 1


def main() -> int:
    """Runs the checks that the command line selects."""
    words = options.parser(__doc__)
    words.add_argument("--write", action="store_true")
    words.add_argument("--advisories", action="store_true")
    arguments = words.parse_args()
    if arguments.advisories:
        return advisories()
    rules = tomllib.loads((ROOT / "deny.toml").read_text())["licenses"]
    allowed = set(rules["allow"])
    rows = crates(rules)
    faults = []
    for row in rows:
        if not is_allowed(row.license, allowed):
            faults.append(f"{row.name} {row.version}: license {row.license}")
        if row.source != REGISTRY:
            faults.append(f"{row.name} {row.version}: from {row.source}")
    layers = layer_faults()
    for fault in layers:
        print(f"dependencies: {fault}, which LAYERS of tools/dependencies.py excludes", file=sys.stderr)
    for fault in faults:
        print(f"dependencies: {fault}, which deny.toml does not allow", file=sys.stderr)
    rust, names = newest_rust(rows)
    of_rust = rust_faults(rust, names)
    for fault in of_rust:
        print(f"dependencies: {fault}", file=sys.stderr)
    head = f"Newest Rust required by a crate: {rust} ({', '.join(names)}).\n\n"
    head += "| crate | version | license | needed by |\n|---|---|---|---|\n"
    table = head + "".join(f"| {row.name} | {row.version} | {row.license} | {row.what} |\n" for row in rows)
    text = TABLE.read_text()
    before, rest = text.split(BEGIN)
    present, after = rest.split(END)
    if arguments.write:
        TABLE.write_text(before + BEGIN + table + END + after)
    elif present != table:
        faults.append("table")
        print(
            "dependencies: docs/internals/dependencies.md is out of date: tools/dependencies.py --write",
            file=sys.stderr,
        )
    print(f"{len(rows)} crates, {sum(row.what == PROGRAMS for row in rows)} of them in the programs")
    return bool(faults or layers or of_rust)


if __name__ == "__main__":
    sys.exit(main())
