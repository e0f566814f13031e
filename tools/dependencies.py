#!/usr/bin/env python3
"""Checks the crates of the workspace and the fuzz targets; writes their table in docs/internals/dependencies.md.

    tools/dependencies.py               fails if the table is out of date, a license is not in deny.toml's list,
                                        a crate does not come from the registry or requires a newer Rust than
                                        rust-version, README.md or fuzz/ state another version, a member of
                                        the workspace depends on what its layer excludes, or files import each
                                        other in a loop
    tools/dependencies.py --write       writes the table

The source is `cargo metadata` of both lock files.
"""

from __future__ import annotations

import json
import re
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
    "virtual_axes_dds": {"mcap", "virtual_axes_core", "virtual_axes_io"},
    "virtual_axes_report": FILES_AND_NETWORK,
    "virtual_axes_py": FILES_AND_NETWORK - {"mcap"},
}
"""Crates that a member of the workspace must not depend on, directly or through others."""
MIDDLEWARE, MIDDLEWARE_OWNER = {"rustdds", "ros2-client"}, "virtual_axes_dds"
"""Crates on which one member alone depends directly."""
ROOTS = {"mod", "lib", "main"}
REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"
PROGRAMS, SECURITY, TESTS, FUZZ = "programs", "feature security", "tests and benchmarks", "fuzz targets"


Module = tuple[str, ...]
Paths = dict[Module, list[str]]


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


def version(text: str | None) -> tuple[int, ...]:
    """Returns a Rust version as numbers, major and minor; none is the oldest."""
    return tuple(int(part) for part in (text or "0.0").split(".")[:2])


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
    clarified = {rule["crate"]: rule["expression"] for rule in rules.get("clarify", [])}
    rows = []
    for key, package in sorted(packages.items()):
        license = package["license"] or clarified.get(key[0], "not stated")
        rows.append(Row(*key, license, where[key], package["source"], package["rust_version"]))
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
        faults += [f"{member} depends on {name}, which its layer excludes" for name in sorted(needed & excluded)]
    known = metadata(ROOT / "Cargo.toml")
    for package in known["packages"]:
        if package["id"] in known["workspace_members"] and package["name"] != MIDDLEWARE_OWNER:
            direct = {dependency["name"] for dependency in package["dependencies"]}
            faults += [f"{package['name']} depends on {name} directly" for name in sorted(direct & MIDDLEWARE)]
    return faults


def use_paths(tree: str) -> list[str]:
    """Returns the paths of a `use` tree, without their other names."""
    head, brace, rest = tree.partition("{")
    if not brace:
        return [re.sub(r"\s+", "", tree.split(" as ")[0])]
    parts, depth = [""], 0
    for letter in rest[: rest.rindex("}")]:
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [head.strip() + path for part in parts if part.strip() for path in use_paths(part.strip())]


def target(module: Module, path: str, uses: Paths, seen: frozenset[str] = frozenset()) -> Module | None:
    """Returns the module that defines what a path in a module names, through re-exports; none outside of the crate."""
    first, *words = path.split("::")
    while first == "super":
        module, first, words = module[:-1], words[0] if words else "self", words[1:]
    module = () if first == "crate" else module
    if first not in ("crate", "self"):
        words = [first, *words]
        if path.startswith(first) and (*module, first) not in uses:
            return None
    while words and (*module, words[0]) in uses:
        module, words = (*module, words[0]), words[1:]
    known = [one for one in uses[module] if words and one.endswith(f"::{words[0]}") and one not in seen]
    return next((found for one in known if (found := target(module, one, uses, seen | {one}))), module)


def loops(source: Path) -> list[str]:
    """Returns the groups of files of a crate that import each other in a loop; tests are left out."""
    imports = r"^\s*(?:pub(?:\([^)]*\))? )?use ([^;]+);"
    uses: Paths = {}
    paths: Paths = {}
    files: dict[Module, Path] = {}
    for file in sorted(source.rglob("*.rs")):
        module = tuple(part for part in file.relative_to(source).with_suffix("").parts if part not in ROOTS)
        if module[:1] != ("bin",):
            code = re.sub(r"//.*|\(in [\w:]+\)", "", re.split(r"#\[cfg\(test\)\]\s*mod \w+ \{", file.read_text())[0])
            uses[module] = [path for tree in re.findall(imports, code, re.M) for path in use_paths(tree)]
            uses |= {(*module, name): [] for name in re.findall(r"#\[path = [^\]]*\]\s*mod (\w+);", code)}
            inline = re.findall(r"(?<![\w:.$])([a-z_]+(?:::\w+)+)", re.sub(imports, "", code, flags=re.M))
            paths[module], files[module] = uses[module] + inline, file
    edges = {one: {target(one, path, uses) for path in paths[one]} & files.keys() - {one} for one in files}
    reached = {one: set(edges[one]) for one in files}
    for between in files:
        for one in files:
            if between in reached[one]:
                reached[one] |= reached[between]
    in_loops = (one for one in files if one in reached[one])
    groups = {frozenset(other for other in reached[one] if one in reached[other]) for one in in_loops}
    return [", ".join(sorted(str(files[one].relative_to(ROOT)) for one in group)) for group in groups]


def main() -> int:
    """Checks the crates, and writes or compares the table."""
    words = options.parser(__doc__)
    words.add_argument("--write", action="store_true")
    arguments = words.parse_args()
    rules = tomllib.loads((ROOT / "deny.toml").read_text())["licenses"]
    rows = crates(rules)
    faults = [f"{row.name} {row.version}: from {row.source}" for row in rows if row.source != REGISTRY]
    for row in rows:
        if not is_allowed(row.license, set(rules["allow"])):
            faults.append(f"{row.name} {row.version}: deny.toml does not allow the license {row.license}")
    newest = max(version(row.rust) for row in rows)
    rust = ".".join(map(str, newest))
    names = [f"{row.name} {row.version}" for row in rows if version(row.rust) == newest]
    faults += layer_faults() + rust_faults(rust, names)
    programs = (folder for folder in ROOT.glob("src/bin/*") if folder.is_dir())
    for source in (*ROOT.glob("crates/*/src"), ROOT / "src", *programs):
        faults += [f"files import each other in a loop: {group}" for group in loops(source)]
    head = f"Newest Rust required by a crate: {rust} ({', '.join(names)}).\n\n"
    head += "| crate | version | license | needed by |\n|---|---|---|---|\n"
    table = head + "".join(f"| {row.name} | {row.version} | {row.license} | {row.what} |\n" for row in rows)
    before, rest = TABLE.read_text().split(BEGIN)
    present, after = rest.split(END)
    if arguments.write:
        TABLE.write_text(before + BEGIN + table + END + after)
    elif present != table:
        faults.append("docs/internals/dependencies.md is out of date: tools/dependencies.py --write")
    for fault in faults:
        print(f"dependencies: {fault}", file=sys.stderr)
    print(f"{len(rows)} crates, {sum(row.what == PROGRAMS for row in rows)} of them in the programs")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
