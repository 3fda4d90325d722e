"""Cuts the signatures that the Unity package uses out of Unity's reference source, and compiles the package with them.

The reference source (github.com/Unity-Technologies/UnityCsReference) may be read but not copied, so it is cut at test
time, from a clone that `MANIPNET_UNITY_REFERENCE` names. Of each type that the stubs stand in for, the public members
remain whose names occur in the package, without their bodies and attributes. Members that name other types are dropped,
so that an error in the package means that Unity has no such member.
"""

import re
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

FOLDERS = ("Runtime", "Modules", "Editor/Mono")
DECLARATION = re.compile(r"\b(?:class|struct|enum|interface)\s+(\w+)")
NOISE = re.compile(
    r'''//[^\n]*|/\*.*?\*/|'(?:\\.|[^'\\\n])+'|(?:\$@|@\$?)"(?:""|[^"])*"|\$?"(?:\\.|[^"\\\n])*"''',
    re.DOTALL,
)
"""Comments, texts and characters, which may hold braces."""
MODIFIERS = re.compile(
    r"\b(extern|unsafe|partial|async|readonly(?=\s+(?:public|struct|int|float|bool|Vector|Quat)))\s+"
)
PROLOGUE = """using System; using System.Collections; using System.Collections.Generic; using UnityEngine;
using Object = UnityEngine.Object; using UnityObject = UnityEngine.Object;
"""
OTHER_TYPES = {"Motion", "ScriptableObject", "PropertyAttribute", "GUILayoutOption", "GUIStyle", "GUIContent", "Rect"}
"""Base types and types of parameters that the package does not name."""


def stubbed_types(stubs: Sequence[Path]) -> set[str]:
    """The names of the types of the engine that the package uses: those for which there are stubs."""
    return {name for stub in stubs for name in DECLARATION.findall(stub.read_text(encoding="utf-8"))}


class Reference:
    """Unity's reference source at one version."""

    def __init__(self, clone: str, version: str) -> None:
        self._clone, self._version = clone, version

    def declarations(self, names: set[str]) -> Iterator[tuple[str, str, str]]:
        """Namespace, header and body of each public declaration of a type; a partial type has several."""
        pattern = rf"\b(class|struct|enum)[ \t]+({'|'.join(sorted(names))})\b"
        command = ["git", "-C", self._clone, "grep", "-lP", pattern, self._version, "--", *FOLDERS]
        files = subprocess.run(command, capture_output=True, encoding="utf-8").stdout.split("\n")
        for file in filter(None, files):
            if not file.endswith(".cs"):
                continue
            shown = subprocess.run(["git", "-C", self._clone, "show", file], capture_output=True, check=True).stdout
            yield from _types_of(_without_noise(shown.decode("utf-8-sig", errors="replace")), names)


def _without_noise(text: str) -> str:
    """The text without comments, the contents of texts, directives, and what follows an #else."""
    text = NOISE.sub(lambda found: " " if found[0].lstrip()[:1] in "/" else '""', text)
    kept, branches = [], []
    for line in text.split("\n"):
        word = line.split()[0] if line.lstrip().startswith("#") and line.split() else ""
        if word.startswith("#if"):
            branches.append(True)
        elif word in ("#else", "#elif"):
            branches[-1] = False
        elif word == "#endif":
            branches.pop()
        elif not word.startswith("#") and all(branches):
            kept.append(line)
    return "\n".join(kept)


def _types_of(text: str, names: set[str]) -> Iterator[tuple[str, str, str]]:
    for namespace in re.finditer(r"namespace\s+([\w.]+)\s*([{;])", text):
        if namespace[1] not in ("UnityEngine", "UnityEditor"):
            continue
        end = _end(text, namespace.end() - 1) if namespace[2] == "{" else len(text)
        for header, body in _members(text[namespace.end() : end]):
            found = re.search(r"\b(class|struct|enum)\s+(\w+)(?![\w<]*<)", header)
            if found and found[2] in names and body is not None and "internal " not in header.split(found[1])[0]:
                yield namespace[1], header, body


def _members(body: str) -> Iterator[tuple[str, str | None]]:
    """The header of each declaration in a body, without attributes, and what is between its braces."""
    start = at = 0
    while at < len(body):
        mark = body[at]
        if mark == "[" and not body[start:at].strip():
            at = start = _end(body, at) + 1
        elif mark in "([":
            at = _end(body, at) + 1
        elif mark == ";":
            yield body[start:at].strip(), None
            at = start = at + 1
        elif mark == "{":
            end = _end(body, at)
            yield body[start:at].strip(), body[at + 1 : end]
            at = start = end + 1
            rest = re.match(r"\s*(=[^=>][^;]*)?;", body[at:])  # an initial value after the accessors
            if rest and rest[1]:
                at = start = at + rest.end()
        else:
            at += 1


def _end(text: str, at: int) -> int:
    """Where the bracket at `at` is closed."""
    depth = 0
    for k in range(at, len(text)):
        depth += (text[k] in "([{") - (text[k] in ")]}")
        if depth == 0:
            return k
    return len(text)


def cut(reference: Reference, names: set[str], used: set[str]) -> dict[str, list[str]]:
    """The members of each type, one a line, by "namespace|kind name : base"."""
    types: dict[str, list[str]] = {}
    bases: dict[str, str] = {}
    names = names | OTHER_TYPES
    for namespace, header, body in reference.declarations(names):
        kind, name = re.search(r"\b(class|struct|enum)\s+(\w+)", header).groups()  # type: ignore[union-attr]
        key = f"{namespace}|{kind} {name}"
        static = "static " if re.search(r"\bstatic\b", header.split(kind)[0]) else ""
        abstract = "abstract " if re.search(r"\babstract\b", header.split(kind)[0]) else ""
        base = re.search(rf"\b{name}\s*:\s*([\w.]+)", header)
        if base and base[1].split(".")[-1] in names | {"Attribute", "IDisposable"} and kind == "class":
            bases[key] = base[1]
        types.setdefault(key, [static + abstract])
        types[key][0] = static or abstract or types[key][0]
        if kind == "enum":
            types[key].append(re.sub(r"\s+", " ", re.sub(r"\[[^\]]*\]", "", body)))
            continue
        for member, inner in _members(body):
            types[key] += _signature(member, inner, name, used)
    return {f"{key}{' : ' + bases[key] if key in bases else ''}": rows for key, rows in types.items()}


def _signature(member: str, inner: str | None, type_name: str, used: set[str]) -> list[str]:
    """The member without its body, or nothing if it is not public or the package does not name it."""
    member = re.sub(r"\s+", " ", member)
    arrow = re.match(r"(.*?)\s*=>", member)
    head = (arrow[1] if arrow else member).strip()
    if " delegate " in head:
        return [f"{head};"]
    if not re.search(r"\b(public|protected)\b", head) or ("implicit operator" in head and type_name != "Object"):
        return []
    head = MODIFIERS.sub("", head.replace("internal protected", "protected").replace("protected internal", "protected"))
    if DECLARATION.search(head) or " event " in f" {head} ":
        event = re.search(r"\bevent [\w.<>]+ (\w+)", head)
        if not event or event[1] not in used:
            return []
        return [head.split("=")[0].strip() + ("; " if inner is None else " { add { } remove { } }")]
    call = re.search(r"([\w.]+|operator\s*\S+|operator [\w.]+)\s*(<[^()]*>)?\s*\(", head)
    if call:
        name = call[1].split(".")[-1]
        constructor = re.search(rf"\b{type_name}\s*\(", head) is not None and name == type_name
        if name not in used and not constructor and not name.startswith("operator"):
            return []
        head = re.sub(r"(?<=[(,])(?:\s*\[[^\]]*\])+\s*", " ", head)  # attributes of parameters
        head = re.sub(r"\)\s*:\s*(base|this)\s*\(.*$", ")", head)
        return [head + (";" if " abstract " in f" {head} " else " { throw null; }")]
    indexer = re.search(r"\bthis\s*\[", head)
    name = re.sub(r"\s*=.*$", "", head).split(" ")[-1].split(",")[0]
    if not indexer and name not in used:
        return []
    if inner is None and not arrow:
        return [re.sub(r"=(?![^\"]*\").*$", "", head).strip() + ";" if " const " not in f" {head} " else head + ";"]
    accessors = _accessors("get;" if arrow else inner or "")
    return [f"{head} {{ {accessors} }}"]


def _accessors(inner: str) -> str:
    found = []
    for part, _ in _members(inner):
        accessor = re.search(r"^(.*?)\b(get|set)\b", part)
        if accessor and "internal" not in accessor[1] and "private" not in accessor[1]:
            found.append(f"{accessor[2]} {{ throw null; }}")
    return " ".join(found)


def write(types: dict[str, list[str]], file: Path, left_out: set[str]) -> None:
    """Write the signatures as C#, a member a line, without the lines that are left out."""
    lines = [PROLOGUE]
    for key, (modifier, *rows) in types.items():
        namespace, declared = key.split("|")
        lines.append(f"namespace {namespace} {{ public {modifier}{declared} {{\n")
        lines += [f"{row}\n" for row in dict.fromkeys(rows) if row not in left_out]
        lines.append("} }\n")
    file.write_text("".join(lines), encoding="utf-8")


def compile_signatures(types: dict[str, list[str]], folder: Path, mcs: str) -> Path:
    """The signatures as a library. Members that do not compile, since they name other types, are dropped."""
    source, library, left_out = folder / "Unity.cs", folder / "Unity.dll", set()
    for _ in range(20):
        write(types, source, left_out)
        done = subprocess.run(
            [mcs, "-langversion:7.2", "-unsafe", "-nowarn:0-9999", "-target:library", f"-out:{library}", str(source)],
            capture_output=True,
            encoding="utf-8",
        )
        if done.returncode == 0:
            return library
        lines = source.read_text(encoding="utf-8").split("\n")
        bad = {lines[int(n) - 1] for n in re.findall(r"Unity\.cs\((\d+),\d+\): error", done.stderr + done.stdout)}
        assert bad - left_out, done.stderr + done.stdout
        left_out |= bad
    raise AssertionError("the signatures do not compile")
