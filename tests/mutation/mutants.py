"""Mutants of a source file: one small change each, such as `<` to `<=`, `+` to `-`, or a constant one larger."""

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass
from functools import singledispatch

_COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
}
_PAIRS = [("min", "max"), ("any", "all"), ("floor", "ceil"), ("sin", "cos"), ("argmin", "argmax"), ("round", "int")]
_COUNTED = 10  # larger numbers are sizes and limits, for which one more or less has hardly an effect
# for rounding errors; every number between these and the sizes of things is right
_TOLERANCES = {float(f"1e-{digits}") for digits in range(7, 31)}
# at equality only; two computed real numbers are equal by chance only, and either result is right then
_BOUNDS = ({ast.Lt, ast.LtE}, {ast.Gt, ast.GtE})
_REAL_FUNCTIONS = {"acos", "atan2", "cos", "dist", "dot", "exp", "hypot", "log", "log10", "sin", "sqrt"}
_FUNCTIONS = dict(_PAIRS) | {second: first for first, second in _PAIRS if first != "round"}
_SIDES = {"left": "right", "right": "left"}  # of numpy.searchsorted
# parameters that change only the appearance of a picture, or the size of a cache
_APPEARANCE = {"alpha", "dpi", "figsize", "fontsize", "lw", "markersize", "maxsize", "ms", "pad", "s", "zorder"}
_UNCHANGED = (ast.JoinedStr, ast.Import, ast.ImportFrom, ast.Raise, ast.Assert)  # texts of messages are not tested


@dataclass(frozen=True)
class Mutant:
    """One change of a source file."""

    path: str  # of the source file, relative to the checkout
    line: int
    begin: int  # bytes of the source that are replaced
    end: int
    before: str
    after: str
    text: str = ""  # the whole line, without its indentation

    def applied(self, source: bytes) -> bytes:
        """Return the source with this change."""
        return source[: self.begin] + self.after.encode() + source[self.end :]

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {_short(self.before)}  →  {_short(self.after)}"


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) < 90 else text[:87] + "..."


def mutants_of(path: str, source: bytes) -> list[Mutant]:
    """Return all mutants of a source file, in the order of its lines; annotations, decorators and texts stay."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found, lines = [], source.decode().splitlines()
    tree = ast.parse(source)
    reals = _real_names(tree)
    for node in _mutable(tree):
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)
        before = source[begin:end].decode()
        for changed in _changes(node):
            if isinstance(node, ast.Compare) and _is_bound(node, changed) and _is_real(node, reals):
                continue
            after = ast.unparse(changed)
            after = f"({after})" if isinstance(changed, ast.expr) else after
            found.append(Mutant(path, node.lineno, begin, end, before, after, lines[node.lineno - 1].strip()))
    return sorted(found, key=lambda mutant: (mutant.line, mutant.begin, mutant.after))


def _is_bound(node: ast.Compare, changed: ast.AST) -> bool:
    """Report whether a changed comparison differs from `node` at equality only."""
    assert isinstance(changed, ast.Compare)
    pairs = ({type(one), type(other)} for one, other in zip(node.ops, changed.ops, strict=True))
    return any(pair in _BOUNDS for pair in pairs)


def _real_names(tree: ast.Module) -> set[str]:
    """Return the names of constants and variables that are assigned real numbers."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and _is_real(node.value, found):
            found |= {one.id for target in node.targets for one in ast.walk(target) if isinstance(one, ast.Name)}
        elif isinstance(node, ast.arg) and isinstance(node.annotation, ast.Name) and node.annotation.id == "FloatArray":
            found.add(node.arg)
    return found


def _is_real(node: ast.AST, reals: set[str]) -> bool:
    """Report whether an expression contains a real number: such a literal or name, a quotient or a function."""
    for part in ast.walk(node):
        match part:
            case ast.Constant(value=float()) if part.value:
                return True
            case ast.BinOp(op=ast.Div()):
                return True
            case ast.Name() if part.id in reals:
                return True
            case ast.Call() if _name_of(part.func) in _REAL_FUNCTIONS:
                return True
    return False


def _name_of(function: ast.expr) -> str | None:
    return getattr(function, "id", None) or getattr(function, "attr", None)


def _is_appearance(node: ast.AST) -> bool:
    """Report whether a node is an argument for the appearance of a picture, or a statement that only draws."""
    match node:
        case ast.keyword():
            return node.arg in _APPEARANCE
        case ast.Expr(value=ast.Call(func=ast.Attribute(value=ast.Name(id="axes" | "figure")))):
            return True
        case ast.Expr(value=ast.Call(args=[ast.Name(id="axes" | "figure"), *_])):
            return True
    return False


def _mutable(node: ast.AST, drawing: bool = False) -> Iterator[ast.expr | ast.stmt]:
    """Yield the statements and expressions below a node that may be changed. `drawing`: in a function that draws."""
    if isinstance(node, _UNCHANGED) or _is_type_checking(node) or _is_appearance(node) or _is_seed(node):
        return
    # a figure in a function that draws is a size or a place on the paper, and a choice of words is an alignment
    figure = node.operand if isinstance(node, ast.UnaryOp) else node
    if drawing and isinstance(figure, ast.Constant) and not isinstance(figure.value, bool):
        return
    if drawing and isinstance(node, ast.IfExp) and _is_text(node.body):
        return
    if isinstance(node, ast.expr | ast.stmt):
        yield node
    drawing = drawing or _is_drawing(node)
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _mutable(child, drawing)


def _is_seed(node: ast.AST) -> bool:
    """Report whether an expression changes a seed: every other seed is as random."""
    return isinstance(node, ast.BinOp) and any(isinstance(one, ast.Name) and one.id == "seed" for one in ast.walk(node))


def _is_drawing(node: ast.AST) -> bool:
    """Report whether a node is a function that draws on given axes, or returns a picture."""
    if not isinstance(node, ast.FunctionDef):
        return False
    annotations = [argument.annotation for argument in node.args.args]
    return any(isinstance(one, ast.Name) and one.id in ("Axes", "Figure") for one in (*annotations, node.returns))


def _is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


@singledispatch
def _changes(node: ast.AST) -> Iterator[ast.AST]:
    """Yield changed copies of a node."""
    yield from ()


@_changes.register
def _(node: ast.Compare) -> Iterator[ast.AST]:
    for number, operator in enumerate(node.ops):
        for other in _COMPARISONS[type(operator)]:
            changed = copy.deepcopy(node)
            changed.ops[number] = other()
            yield changed


@_changes.register
def _(node: ast.BinOp) -> Iterator[ast.AST]:
    other = _ARITHMETIC.get(type(node.op))
    if other and not _is_text(node.left) and not _is_text(node.right):
        yield ast.BinOp(node.left, other(), node.right)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str | bytes))


@_changes.register
def _(node: ast.AugAssign) -> Iterator[ast.AST]:
    if other := _ARITHMETIC.get(type(node.op)):
        yield ast.AugAssign(node.target, other(), node.value)


@_changes.register
def _(node: ast.BoolOp) -> Iterator[ast.AST]:
    yield ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)


@_changes.register
def _(node: ast.UnaryOp) -> Iterator[ast.AST]:
    if isinstance(node.op, ast.Not | ast.USub):
        yield node.operand


@_changes.register
def _(node: ast.Constant) -> Iterator[ast.AST]:
    match node.value:
        case bool():
            yield ast.Constant(not node.value)
        case int() if abs(node.value) < _COUNTED:
            yield ast.Constant(node.value + 1)
            yield ast.Constant(node.value - 1)
        case int():
            yield ast.Constant(node.value + node.value // 2)
        case float() if node.value not in _TOLERANCES:
            yield ast.Constant(1.5 * node.value if node.value else 1.0)
        case "left" | "right":
            yield ast.Constant(_SIDES[node.value])


@_changes.register
def _(node: ast.Call) -> Iterator[ast.AST]:
    name = _name_of(node.func)
    if name == "abs" and len(node.args) == 1:
        yield node.args[0]
    if name in _FUNCTIONS:
        changed = copy.deepcopy(node)
        setattr(changed.func, "id" if isinstance(changed.func, ast.Name) else "attr", _FUNCTIONS[name])
        # int(x, digits) would be an error
        if name != "round" or (isinstance(node.func, ast.Name) and len(node.args) == 1):
            yield changed


@_changes.register
def _(node: ast.IfExp) -> Iterator[ast.AST]:
    yield ast.IfExp(node.test, node.orelse, node.body)


@_changes.register
def _(node: ast.Return) -> Iterator[ast.AST]:
    # False and None are alike to a condition; True and False are changed as constants
    if not (node.value is None or (isinstance(node.value, ast.Constant) and isinstance(node.value.value, bool | None))):
        yield ast.Return(ast.Constant(None))


@_changes.register
def _(node: ast.Expr) -> Iterator[ast.AST]:
    if isinstance(node.value, ast.Call):
        yield ast.Pass()


@_changes.register
def _(node: ast.Break) -> Iterator[ast.AST]:
    yield ast.Continue()


@_changes.register
def _(node: ast.Continue) -> Iterator[ast.AST]:
    yield ast.Break()
