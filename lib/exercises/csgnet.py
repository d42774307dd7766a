"""Checkers for 09_csgnet_supervised."""

import math
from collections.abc import Callable
from itertools import product

import torch
from torch import Tensor

from ..interpreters.csg import Program, ProgramError, execute, parse, vocabulary_of
from ..metrics.images import image_chamfer
from ..models.csgnet import CSGNet, CSGNetConfig
from ..models.csgnet_beams import beam_search
from ..models.csgnet_grammar import LONGEST, allowed
from . import OK, UNANSWERED, hint

LETTERS = "PO$"  # exercise 9.2: primitive, operation, end
DEEPEST, ROOM = 4, 6  # parts, and room up to which exercise 9.2 is tried
NEAR = 0.05  # exercise 9.3: error of a loss allowed: one decimal is enough
MISSED = 1.0  # px, exercise 9.5: how far all of the network's programs have to be
BEAMS = 10  # exercise 9.5
LEAST_ON = 144  # pixels, exercise 9.5: as the random programs have


def seen_pixels(config: CSGNetConfig) -> int:
    """How many pixels along a side of the picture reach one number of the last maps."""
    seen, step = 1, 1
    for kernel, stride, pool in zip(config.kernels, config.strides, config.pools):
        seen += (kernel - 1) * step
        step *= stride
        seen += (pool - 1) * step
        step *= pool
    return seen


def check_seen(answer: object, config: CSGNetConfig) -> str:
    """Exercise 9.1: how many pixels along a side one number of the last maps depends on."""
    found = _number(answer)
    if isinstance(found, str):
        return found
    wanted = seen_pixels(config)
    if found == wanted:
        return OK
    if found == 1 + sum(kernel - 1 for kernel in config.kernels):
        return hint("a step in a later layer is several pixels: strides multiply")
    if found == math.prod(config.strides) * math.prod(config.pools):
        return hint("so far two neighbours are apart; how far does each see?")
    return hint(f"{found:g} is too {'few' if found < wanted else 'many'}")


def check_rules(answer: object) -> str:
    """Exercise 9.2: a function from parts and room to what may come next: some of the letters P, O and $.

    One that returns None for no parts and room for one token has not been written yet.
    """
    if answer is None:
        return UNANSWERED
    if not callable(answer):
        return hint("the answer is a function: give its name, without brackets after it")
    try:
        if answer(0, 1) is None:
            return UNANSWERED
    except (Exception, SystemExit):
        pass  # told below
    for parts, room in product(range(DEEPEST + 1), range(ROOM + 1)):
        if parts <= room + 1 and (problem := _wrong_rule(answer, parts, room)):
            return hint(problem)
    return OK


def _wrong_rule(answer: Callable, parts: int, room: int) -> str:
    """What is wrong with the function's answer for one case, or nothing."""
    place = f"for {parts} parts and room {room}"
    try:
        found = {str(letter)[:9] for letter in answer(parts, room)}
    except (Exception, SystemExit) as error:  # what is wrong with a reader's function becomes a hint
        return f"{place} it raises {type(error).__name__}"
    if unknown := sorted(found - set(LETTERS)):
        return f"{place} it says {unknown[0]!r}; the letters are P, O and $"
    yes = torch.ones(1, dtype=torch.bool)
    # a vocabulary with one primitive: P + * - $
    rule = allowed(torch.tensor([parts]), yes, room, 5)[0]
    wanted = {letter for letter, token in zip(LETTERS, (0, 1, 4)) if rule[token]}
    if extra := sorted(found - wanted):
        return f"{place}, {extra[0]} leads to no program, or to one that is too long"
    if missing := sorted(wanted - found):
        return f"{place}, {missing[0]} may come, too"
    return ""


def blind_loss(tokens: int = 3) -> float:
    """Mean cost of a token, the end included, to somebody who knows the length and all rules, but sees no picture."""
    primitives, operations = (tokens + 1) // 2, tokens // 2
    return (primitives * math.log(len(vocabulary_of(2).primitives)) + operations * math.log(3)) / (tokens + 1)


def check_blind(answer: object) -> str:
    """Exercise 9.3: the loss on programs of three tokens of a network that knows the language and sees nothing."""
    found = _number(answer)
    if isinstance(found, str):
        return found
    wanted = blind_loss()
    if abs(found - wanted) <= NEAR:
        return OK
    if abs(found - wanted * 4) <= 4 * NEAR:
        return hint(
            "that is the cost of the whole program; the loss is the mean over its tokens, the end included"
        )
    if abs(found - wanted * 4 / 3) <= NEAR:
        return hint("the end is a token, too: it costs nothing, but it counts")
    if abs(found - math.log(400)) <= NEAR:
        return hint("that does not know the rules: it takes an operation for possible everywhere")
    return hint(f"{found:.3g} is too {'little' if found < wanted else 'much'}")


def check_step(answer: object) -> str:
    """Exercise 9.4: one step of beam search, a function of totals (beams,), odds (beams, tokens) and k that returns the
    k likeliest continuations, pairs (beam, token), the likeliest first."""
    if answer is None:
        return UNANSWERED
    if not callable(answer):
        return hint("the answer is a function: give its name, without brackets after it")
    generator = torch.Generator().manual_seed(9)
    for beams, tokens, k in ((1, 4, 1), (1, 5, 3), (3, 5, 3), (4, 7, 10)):
        scores = torch.randn(beams, tokens, generator=generator) * 2
        totals = torch.randn(beams, generator=generator) * 2
        verdict = _check_step(answer, totals, scores.log_softmax(1), k)
        if verdict != OK:
            return verdict
    return OK


def _check_step(function: Callable, totals: Tensor, odds: Tensor, k: int) -> str:
    given = f"{len(totals)} beginnings, {odds.shape[1]} tokens, k = {k}"
    try:
        found = function(totals.clone(), odds.clone(), k)
        if found is None:
            return UNANSWERED
        found = [(int(beam), int(token)) for beam, token in found]
    except (Exception, SystemExit) as error:  # what is wrong with a reader's function becomes a hint
        return hint(f"with {given} it raises {type(error).__name__}: it should return pairs (beam, token)")
    wanted = _best(totals.unsqueeze(1) + odds, k)
    if found == wanted:
        return OK
    if len(found) != k:
        return hint(f"with {given} it returns {len(found)} pairs")
    if found == _best(odds, k):
        return hint("the beginnings have probabilities, too")
    if sorted(found) == sorted(wanted):
        return hint("the right ones, but the likeliest should come first")
    return hint(f"with {given} the likeliest is {wanted[0]}, it returns {str(found)[:60]}")


def _best(sums: Tensor, k: int) -> list[tuple[int, int]]:
    places = sums.flatten().sort(descending=True, stable=True).indices[:k].tolist()
    return [divmod(place, sums.shape[1]) for place in places]


def missed_by(network: CSGNet, program: Program) -> float:
    """The Chamfer distance, px, of the best of BEAMS programs that the network writes for a program's picture."""
    target = execute(program).image
    beams = beam_search(network, target.unsqueeze(0), BEAMS).tokens[0]
    programs = [vocabulary_of(2).program(tokens) for tokens in beams]
    images = torch.stack([execute(each).image for each in programs])
    return float(image_chamfer(target.expand_as(images), images).min())


def check_fooled(answer: object, network: CSGNet) -> str:
    """Exercise 9.5: a program in the vocabulary, not longer than the network's, whose picture the network misses."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, str | Program):
        return hint(f"the answer is a program as a text, this is of type {type(answer).__name__}")
    try:
        program = answer if isinstance(answer, Program) else parse(answer)
        if program.dimensions != 2:
            return hint("this is a program of space; write one of the plane, with c, s and t")
        program.tokens(vocabulary_of(2))
    except ProgramError as error:
        return hint(str(error))
    if len(program) > LONGEST[2]:
        return hint(f"{len(program)} tokens; the network may write {LONGEST[2]}")
    if (on := execute(program).on) < LEAST_ON:
        return hint(f"{on} pixels are ON; it has never seen fewer than {LEAST_ON}")
    missed = missed_by(network, program)
    return (
        OK if missed >= MISSED else hint(f"the best of {BEAMS} is {missed:.2f} px away; {MISSED:g} will do")
    )


def _number(answer: object) -> float | str:
    """The answer as a number, or what to tell the reader."""
    if answer is None:
        return UNANSWERED
    try:
        found = float(answer)
    except Exception:
        return hint(f"the answer is a number, this is of type {type(answer).__name__}")
    return found if math.isfinite(found) else hint("the answer is a finite number")
