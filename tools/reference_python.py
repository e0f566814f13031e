"""Page of the Python module: signatures and documentation of its public names, read from its sources."""

from __future__ import annotations

import ast
import textwrap
from pathlib import Path

from reference_markdown import page

PACKAGE = Path(__file__).resolve().parent.parent / "crates/py/python/virtual_axes_py"
PARTS = [
    ("__init__.py", "virtual_axes_py"),
    ("design.py", "virtual_axes_py.design"),
    ("gym.py", "virtual_axes_py.gym"),
    ("ros/__init__.py", "virtual_axes_py.ros"),
]
NATIVE = {
    "Scenario": "Test motion of a scenario, planned within the limits of a machine: `name`, `description`, and "
    "`psec(machine)`, an array (setpoints, axes), m or rad.",
    "PartProgram": "Part program in G code: `path`, and `psec(machine)`, an array (setpoints, axes), m or rad.",
    "machine_names": "Names of the built-in machines, the default first.",
    "nc_program_names": "Names of the built-in part programs.",
    "scenario_names": "Names of the built-in scenarios.",
    "PredictionModel": "Discrete transfer function from Ω* to θ, `A(q⁻¹) θ = B(q⁻¹) Ω*`: coefficients `a`, `b`, and "
    "`period`, s.",
    "Rst": "Position controller `S Ω* = T θ* − R θ`: coefficients `r`, `s`, `t`, and `t_first`, the exponent of q of "
    "`t[0]`.",
}
"""Documentation of names of the native module."""
Definition = ast.FunctionDef | ast.ClassDef


class Module:
    """Definitions of a module of the package and of those that it imports."""

    def __init__(self, path: Path) -> None:
        """Reads the sources."""
        self.path = path
        self.tree = ast.parse(path.read_text(encoding="utf-8"))

    def public(self) -> list[str]:
        """Returns the names of `__all__`, in alphabetical order; without it all public definitions."""
        for node in self.tree.body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                return sorted(ast.literal_eval(node.value), key=str.lower)
        definitions = [node.name for node in self.tree.body if isinstance(node, Definition)]
        return sorted((name for name in definitions if not name.startswith("_")), key=str.lower)

    def description(self) -> str:
        """Returns the documentation of the module, with its example as a block."""
        lines = (ast.get_docstring(self.tree) or "").splitlines()
        text, example = [], []
        for line in lines:
            if line.startswith("    ") or (example and not line and not text[-1:] == ["```"]):
                if not example:
                    text.append("```python")
                example.append(line)
                text.append(line[4:])
            else:
                if example and text[-1] == "":
                    text.pop()
                if example:
                    text += ["```", ""]
                    example = []
                text.append(line)
        return "\n".join([*text, "```"] if example else text).strip()

    def find(self, name: str) -> tuple[Definition | ast.Assign, str, Module] | None:
        """Returns the definition of a name, the documentation of a constant, and its module; None for a native name."""
        for position, node in enumerate(self.tree.body):
            if isinstance(node, Definition) and node.name == name:
                return node, "", self
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
                return node, _text_after(self.tree.body, position), self
            if isinstance(node, ast.ImportFrom) and node.level and any(alias.name == name for alias in node.names):
                if node.module in (None, "_native"):
                    return None
                file = self.path.parent.joinpath(*node.module.split(".")).with_suffix(".py")
                return Module(file).find(name)
        return None


def _text_after(body: list[ast.stmt], position: int) -> str:
    """Returns the documentation string after a statement."""
    after = body[position + 1] if position + 1 < len(body) else None
    if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str):
        return textwrap.dedent(after.value.value)
    return ""


def _signature(node: ast.FunctionDef, name: str) -> str:
    """Returns the signature of a function, without `self` and on lines of its own where it is long."""
    arguments = node.args
    if arguments.args and arguments.args[0].arg == "self":
        arguments.args.pop(0)
    returned = f" -> {ast.unparse(node.returns)}" if node.returns is not None else ""
    return f"{name}({ast.unparse(arguments)}){returned}"


def _is_property(node: ast.FunctionDef) -> bool:
    return any(ast.unparse(one) in ("property", "cached_property") for one in node.decorator_list)


def _is_dataclass(node: ast.ClassDef) -> bool:
    return any(ast.unparse(one).startswith("dataclass") for one in node.decorator_list)


def _paragraphs(text: str | None) -> str:
    """Returns a documentation string with its examples as blocks."""
    lines, code = [], False
    for line in (text or "").splitlines():
        is_code = line.startswith(">>> ") or (code and line.strip() != "")
        if is_code != code:
            lines.append("```pycon" if is_code else "```")
            code = is_code
        lines.append(line)
    return "\n".join([*lines, "```"] if code else lines)


def _code(text: str) -> str:
    return f"```python\n{textwrap.fill(text, 110, subsequent_indent='    ', break_long_words=False)}\n```"


def _bases(node: ast.ClassDef, module: Module) -> list[ast.ClassDef]:
    """Returns the base classes within the package, the nearest first."""
    classes = []
    for base in node.bases:
        found = module.find(ast.unparse(base))
        if found is not None and isinstance(found[0], ast.ClassDef):
            classes += [found[0], *_bases(found[0], found[2])]
    return classes


def _class(node: ast.ClassDef, module: Module) -> list[str]:
    """Returns documentation, fields, properties and methods of a class and of its bases in the package."""
    parts = [_paragraphs(ast.get_docstring(node))]
    bodies = [node, *_bases(node, module)]
    fields, methods = [], []
    for body in bodies:
        for position, one in enumerate(body.body):
            if isinstance(one, ast.AnnAssign) and not ast.unparse(one.target).startswith("_"):
                text = _text_after(body.body, position)
                fields.append(f"- `{ast.unparse(one.target)}: {ast.unparse(one.annotation)}`: {' '.join(text.split())}")
            elif isinstance(one, ast.FunctionDef) and (
                not one.name.startswith("_") or (one.name == "__init__" and body is node)
            ):
                text = ast.get_docstring(one) or ""
                if _is_property(one):
                    fields.append(f"- `{one.name}`: {' '.join(text.split())}")
                elif one.name != "__init__" or not _is_dataclass(node):
                    called = node.name if one.name == "__init__" else f"{node.name}.{one.name}"
                    methods += [_code(_signature(one, called).removesuffix(" -> None")), _paragraphs(text)]
    return parts + (["\n".join(fields)] if fields else []) + methods


def _entry(module: Module, name: str) -> list[str]:
    """Returns the section of a public name."""
    found = module.find(name)
    if found is None:
        return [f"### {name}", NATIVE[name]] if name in NATIVE else []
    node, text, origin = found
    if isinstance(node, ast.ClassDef):
        return [f"### {name}", *_class(node, origin)]
    if isinstance(node, ast.FunctionDef):
        return [f"### {name}", _code(_signature(node, name)), _paragraphs(ast.get_docstring(node))]
    return [f"### {name}", " ".join(text.split()) or f"`{ast.unparse(node)}`"]


def python_page() -> str:
    """Returns the page of all public names of the Python module."""
    parts = []
    for file, title in PARTS:
        module = Module(PACKAGE / file)
        parts += [f"## {title}", module.description()]
        for name in module.public():
            parts += _entry(module, name)
    return page(
        "Python module",
        "Public names of the module `virtual_axes_py`; [Simulate from Python](../how-to/python.md) has examples.",
        *parts,
    )
