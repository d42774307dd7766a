"""Checkers for 08_csg_language, and the pictures they are about."""

import random
from collections.abc import Callable
from itertools import product

from jaxtyping import Bool
from torch import Tensor

from ..interpreters.csg import OPERATIONS, Picture, Program, ProgramError, execute, parse, vocabulary_of
from ..interpreters.csg.vocabulary import WORDS
from ..metrics.images import iou
from ..models.csgnet_grammar import LONGEST
from . import OK, UNANSWERED, hint

LARGE = 3600  # pixels of exercise 8.2; the most that five tokens can switch on is 3,653
ALIKE = 0.95  # intersection over union of exercise 8.4
LONG_WINDED = "c(24,32,20)c(24,32,12)+s(40,40,16)+s(40,40,16)c(40,40,8)+c(48,48,8)s(40,40,16)*+-"
_HOUSE = "s(32,40,24)t(32,24,24)+s(32,48,12)-c(32,24,8)-"
_WRITTEN = {"primitive": ("c(32,32,16)", "s(24,40,12)", "t(32,24,20)"), "operation": tuple(OPERATIONS)}


def house() -> Bool[Tensor, "64 64"]:
    """Exercise 8.4: the picture to match, image[y, x]."""
    return execute(parse(_HOUSE)).image


def check_validity(answer: object) -> str:
    """Exercise 8.1: a function from a list of tokens (texts) to whether they are one whole program.

    One that returns None even for a single primitive has not been written yet.
    """
    if answer is None:
        return UNANSWERED
    if not callable(answer):
        return hint("the answer is a function: give its name, without brackets after it")
    return _compared(answer)


def _compared(answer: Callable) -> str:
    """The function on every order of primitives and operations up to seven tokens."""
    pick = random.Random(8)
    for length in range(8):
        for pattern in product(_WRITTEN, repeat=length):
            tokens = [pick.choice(_WRITTEN[role]) for role in pattern]
            try:
                found = answer(list(tokens))
                yes, shown = bool(found), repr(found)[:80]
            except (Exception, SystemExit) as error:  # what is wrong with a reader's function becomes a hint
                return hint(f"for {tokens} it raises {type(error).__name__}")
            if found is None and length == 1 and _is_program(tokens):
                return UNANSWERED
            if yes != _is_program(tokens):
                return hint(f"for {tokens} it says {shown}")
    return OK


def _is_program(tokens: list[str]) -> bool:
    try:
        return len(parse("".join(tokens))) > 0
    except ProgramError:
        return False


def check_empty(answer: object) -> str:
    """Exercise 8.2: a program of five tokens, in the vocabulary, whose picture is blank."""
    picture = _picture(answer, 5)
    if isinstance(picture, str):
        return picture
    return OK if not picture.on else hint(f"{picture.on} pixels are still ON")


def check_large(answer: object) -> str:
    """Exercise 8.2: a program of five tokens, in the vocabulary, with at least LARGE pixels ON."""
    picture = _picture(answer, 5)
    if isinstance(picture, str):
        return picture
    return OK if picture.on >= LARGE else hint(f"{picture.on:,} pixels are ON, {LARGE:,} will do")


def check_short(answer: object) -> str:
    """Exercise 8.3: a program of three tokens that makes the picture of LONG_WINDED."""
    picture = _picture(answer, 3)
    if isinstance(picture, str):
        return picture
    differ = int((picture.image ^ execute(parse(LONG_WINDED)).image).sum())
    return OK if not differ else hint(f"its picture differs in {differ} pixels")


def check_house(answer: object) -> str:
    """Exercise 8.4: a program of at most LONGEST tokens, in the vocabulary, that overlaps the house by ALIKE."""
    picture = _picture(answer)
    if isinstance(picture, str):
        return picture
    if len(picture.program) > LONGEST[2]:
        return hint(f"{len(picture.program)} tokens; a network may write {LONGEST[2]}")
    overlap = iou(picture.image, house()).item()
    wanted = f"{ALIKE:g} will do"
    return OK if overlap >= ALIKE else hint(f"intersection over union is {overlap:.3f}, {wanted}")


def _picture(answer: object, tokens: int | None = None) -> Picture | str:
    """The picture of a program in the networks' vocabulary, with so many tokens; or what to tell the reader."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, str | Program):
        return hint(f"the answer is a program as a text, this is of type {type(answer).__name__}")
    try:
        program = answer if isinstance(answer, Program) else parse(answer)
        if program.dimensions != 2:
            return hint("this is a program of space; write one of the plane, with c, s and t")
    except ProgramError as error:
        return hint(str(error))
    for primitive in program.primitives:
        if primitive not in vocabulary_of(2).primitives:
            return hint(f"{primitive} is not among the 400 tokens: {WORDS}")
    if tokens is not None and len(program) != tokens:
        return hint(f"it has {len(program)} token{'s' * (len(program) != 1)}, write {tokens}")
    return execute(program)
