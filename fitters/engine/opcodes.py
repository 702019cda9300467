"""The instruction set: which opcode an operation on vectors (v) and scalars (s) has."""

from enum import StrEnum


class Form(StrEnum):
    """What the operands are, in order."""

    V = "v"
    S = "s"
    VV = "vv"
    VS = "vs"
    SV = "sv"


_FORMS = [
    ("fill", (Form.S,)),
    ("add", (Form.VV, Form.VS)),
    ("sub", (Form.VV, Form.VS, Form.SV)),
    ("mul", (Form.VV, Form.VS)),
    ("div", (Form.VV, Form.VS, Form.SV)),
    ("max", (Form.VV, Form.VS)),
    ("min", (Form.VV, Form.VS)),
    ("pow", (Form.VV, Form.VS, Form.SV)),
    ("neg", (Form.V,)),
    ("sin", (Form.V,)),
    ("cos", (Form.V,)),
    ("tan", (Form.V,)),
    ("exp", (Form.V,)),
    ("asin", (Form.V,)),
    ("acos", (Form.V,)),
    ("atan", (Form.V,)),
    ("sqrt", (Form.V,)),
    ("log", (Form.V,)),
]

OPCODE = {
    (operator, form): opcode
    for opcode, (operator, form) in enumerate((op, form) for op, forms in _FORMS for form in forms)
}

SCALAR_OPCODE = {operator: number for number, (operator, _) in enumerate(_FORMS)}
