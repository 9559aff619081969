"""The built-in splitting methods: coefficients, source and a line of words. An entry of `METHODS` makes a method.

A table alternates kicks b_0 .. b_n with drifts a_1 .. a_n; both sum to 1 and all of these but one, the symplectic Euler
method, read the same from both ends. Three shapes:

    strang_steps   kick-drift-kick steps of lengths gamma_i h, for any splitting; order conditions sum gamma^3 = 0 (4),
                   sum gamma^5 = 0 and two more (6), ...
    kick_first     b_0 .. b_n with neither end zero, n forces a step
    drift_first    b_0 = b_n = 0: n - 1 forces and n drifts a step

Only the outer coefficients are written down, as published; the inner ones close the sum. Every method of quadrature
order p has sum_i b_i t_i^k = 1/(k + 1) for k < p, t_i the sum of the drifts before kick i, whatever the two flows are:
the first number of a generalised order (8, 6, 4) [McLachlan, BIT 35 (1995) 258].
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from symtop.methods.splitting.loop import exact_sum


class Table(NamedTuple):
    """A composition: drifts a_1 .. a_n, kicks b_0 .. b_n and their force gradients c_0 .. c_n."""

    order: int
    drift: tuple[float, ...]
    kick: tuple[float, ...]
    gradient: tuple[float, ...] | None = None


def palindrome(outer: Sequence[float], *, odd: bool) -> tuple[float, ...]:
    """`outer`, then one middle value (or two equal ones) that make the sum 1, then `outer` backwards."""
    half = math.fsum([0.5, *(-value for value in outer)])  # rounded once
    return (*outer, *((2.0 * half,) if odd else (half, half)), *reversed(outer))


def strang_steps(order: int, outer: Sequence[float]) -> Table:
    """A symmetric composition of kick-drift-kick steps; neighbouring half kicks merge."""
    steps = palindrome(outer, odd=True)
    halves = [0.5 * (left + right) for left, right in zip((0.0, *steps), (*steps, 0.0), strict=True)]
    return Table(order, steps, exact_sum(halves))


def kick_first(order: int, drift: Sequence[float], kick: Sequence[float]) -> Table:
    """Kick, drift, ... kick from the outer coefficients: as many of either for an odd number of drifts."""
    odd = len(drift) == len(kick)
    return Table(order, palindrome(drift, odd=odd), palindrome(kick, odd=not odd))


def drift_first(order: int, drift: Sequence[float], kick: Sequence[float]) -> Table:
    """Drift, kick, ... drift from the outer coefficients: as many of either for an odd number of kicks."""
    odd = len(drift) == len(kick)
    return Table(order, palindrome(drift, odd=not odd), (0.0, *palindrome(kick, odd=odd), 0.0))


class Splitting(NamedTuple):
    """A built-in method: the arguments of `symtop.methods.splitting.composition.composition` beside its name."""

    table: Table
    reference: str  # keys of citations.bib; of the turns of a body, behind its chart
    summary: str
    chart: str = "space"
    rotation: str = "exact"
    processor: float = 0.0


STRANG = strang_steps(2, ())  # Stormer-Verlet if T = p^2/2
YOSHIDA_4 = strang_steps(4, (1.0 / (2.0 - 2.0 ** (1.0 / 3.0)),))  # the triple jump
SUZUKI_4 = strang_steps(4, (1.0 / (4.0 - 4.0 ** (1.0 / 3.0)),) * 2)  # the fractal with five parts
TAKAHASHI_IMADA = Table(4, STRANG.drift, STRANG.kick, (-1.0 / 48.0, -1.0 / 48.0))  # of order 4 with its processor

# fmt: off
BLANES_MOAN_11 = kick_first(
    6,
    (0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075, 0.357208872795928),
    (0.0414649985182624, 0.198128671918067, -0.0400061921041533, 0.0752539843015807, -0.0115113874206879),
)

BLANES_MOAN_6 = kick_first(  # for two parts of any kind
    4, (0.209515106613362, -0.143851773179818), (0.0792036964311957, 0.353172906049774, -0.0420650803577195))

METHODS = {
    "stormer-verlet": Splitting(
        STRANG, "hairer-lubich-wanner-2003", "kick-drift-kick splitting of the reduced Hamiltonian", "angles"),
    "symplectic-euler": Splitting(
        Table(1, (1.0,), (1.0, 0.0)), "hairer-lubich-wanner-2006",
        "a kick and a drift of the reduced Hamiltonian, one force", "angles"),
    "stormer-verlet-yoshida-4": Splitting(YOSHIDA_4, "yoshida-1990", "three Stormer-Verlet steps", "angles"),
    "stormer-verlet-suzuki-4": Splitting(SUZUKI_4, "suzuki-1990", "five Stormer-Verlet steps", "angles"),
    "stormer-verlet-blanes-moan-6": Splitting(  # more accurate here than the table of srkn-14-6
        BLANES_MOAN_11, "blanes-moan-2002",
        "Runge-Kutta-Nystrom splitting of the reduced Hamiltonian, 11 forces", "angles"),
    "strang": Splitting(STRANG, "touma-wisdom-1994", "free top and gravity kicks, one force"),
    "strang-drift-first": Splitting(
        drift_first(2, (), ()), "touma-wisdom-1994", "gravity kick between two halves of the free top, one force"),
    "cayley": Splitting(
        STRANG, "bobenko-suris-1999",
        "Cayley rotation and gravity kicks, an integrable map, one force", rotation="cayley"),
    "cayley-tuned": Splitting(
        STRANG, "bobenko-suris-1999",
        "Cayley rotation by the right mean angle and gravity kicks, an integrable map, one force",
        rotation="cayley-tuned"),
    "takahashi-imada": Splitting(
        TAKAHASHI_IMADA, "takahashi-imada-1984 rowlands-1991",
        "free top and kicks with a force gradient, processed, one force", processor=1.0 / 12.0),
    "chin-4a": Splitting(
        Table(4, (0.5, 0.5), palindrome((1.0 / 6.0,), odd=True), (0.0, -1.0 / 72.0, 0.0)),
        "chin-1997 body:blanes-moan-2002", "free top and positive kicks with a force gradient, two forces"),
    "yoshida-4": Splitting(YOSHIDA_4, "yoshida-1990", "free top and gravity kicks, three Strang steps"),
    "suzuki-4": Splitting(SUZUKI_4, "suzuki-1990", "free top and gravity kicks, five Strang steps"),
    "srkn-6-4": Splitting(
        kick_first(4, (0.245298957184271, 0.604872665711080),
                   (0.0829844064174052, 0.396309801498368, -0.0390563049223486)),
        "blanes-moan-2002", "free top and gravity kicks, Runge-Kutta-Nystrom, 6 forces"),
    "srkn-11-6": Splitting(
        BLANES_MOAN_11, "blanes-moan-2002 body:kahan-li-1997",
        "free top and gravity kicks, Runge-Kutta-Nystrom, 11 forces"),
    "srkn-14-6": Splitting(
        drift_first(
            6,
            (0.0378593198406116, 0.102635633102435, -0.0258678882665587, 0.314241403071447,
             -0.130144459517415, 0.106417700369543, -0.00879424312851058),
            (0.09171915262446165, 0.183983170005006, -0.05653436583288827, 0.004914688774712854,
             0.143761127168358, 0.328567693746804)),
        "blanes-moan-2002 body:kahan-li-1997", "free top and gravity kicks, Runge-Kutta-Nystrom, 14 forces"),
    "srkn-19-8": Splitting(  # B_19 of the paper; checked by the conditions in `tests`
        kick_first(
            8,
            (0.337548675291317241942440116575, -0.223647977575409990331768222380, 0.168949714872223740906385138015,
             0.171179938816205886154783136334, -0.349765168067292877221144631312, 0.523808861006312397712070357524,
             -0.194208871063049124066394765282, -0.323496751337931087309823477561, 0.322817287614899749216601693799),
            (0.036132460472136313416730168194, 0.012697863961074113381675193011, 0.201318391240629276109068041836,
             0.135683350134504233201330671671, -0.0579071833999963041504740663015,
             -0.0772509501792649549463874931821, -0.00264758266409925952822161203471,
             -0.0329844384945603065320797537355, 0.0476781560950366927530646289755)),
        "blanes-casas-escorihuela-tomas-2022 body:kahan-li-1997",
        "free top and gravity kicks, Runge-Kutta-Nystrom, 19 forces"),
    "kahan-li-6": Splitting(
        strang_steps(6, (
            0.39216144400731413927925056, 0.33259913678935943859974864,
            -0.70624617255763935980996482, 0.08221359629355080023149045)),
        "kahan-li-1997", "free top and gravity kicks, 9 Strang steps"),
    "suzuki-umeno-8": Splitting(
        strang_steps(8, (
            0.74167036435061295344822780, -0.40910082580003159399730010, 0.19075471029623837995387626,
            -0.57386247111608226665638773, 0.29906418130365592384446354, 0.33462491824529818378495798,
            0.31529309239676659663205666)),
        "suzuki-umeno-1993 mclachlan-1995", "free top and gravity kicks, 15 Strang steps"),
    "kahan-li-8": Splitting(
        strang_steps(8, (
            0.13020248308889008087881763, 0.56116298177510838456196441, -0.38947496264484728640807860,
            0.15884190655515560089621075, -0.39590389413323757733623154, 0.18453964097831570709183254,
            0.25837438768632204729397911, 0.29501172360931029887096624)),
        "kahan-li-1997", "free top and gravity kicks, 17 Strang steps"),
    "sofroniou-spaletta-10": Splitting(
        strang_steps(10, (
            0.07879572252168641926390768, 0.31309610341510852776481247, 0.02791838323507806610952027,
            -0.22959284159390709415121340, 0.13096206107716486317465686, -0.26973340565451071434460973,
            0.07497334315589143566613711, 0.11199342399981020488957508, 0.36613344954622675119314812,
            -0.39910563013603589787862981, 0.10308739852747107731580277, 0.41143087395589023782070412,
            -0.00486636058313526176219566, -0.39203335370863990644808194, 0.05194250296244964703718290,
            0.05066509075992449633587434, 0.04967437063972987905456880)),
        "sofroniou-spaletta-2005", "free top and gravity kicks, 35 Strang steps"),
    # generalised orders, for one part much smaller than the other: errors eps h^8 + eps^2 h^6 + eps^3 h^4,
    # eps h^10 + eps^2 h^6 + eps^3 h^4, eps h^10 + eps^2 h^4
    "aba-8-6-4": Splitting(
        drift_first(
            4,
            (0.0711334264982231177779387300061549964174, 0.241153427956640098736487795326289649618,
             0.521411761772814789212136078067994229991),
            (0.183083687472197221961703757166430291072, 0.310782859898574869507522291054262796375,
             -0.0265646185119588006972121379164987592663)),
        "blanes-casas-farres-laskar-makazaga-murua-2013 body:blanes-moan-2002",
        "free top and gravity kicks, generalised order (8, 6, 4), 7 forces"),
    "aba-10-6-4": Splitting(
        drift_first(
            4,
            (0.03809449742241219545697532230863756534060, 0.1452987161169137492940200726606637497442,
             0.2076276957255412507162056113249882065158, 0.4359097036515261592231548624010651844006),
            (0.09585888083707521061077150377145884776921, 0.2044461531429987806805077839164344779763,
             0.2170703479789911017143385924306336714532)),
        "blanes-casas-farres-laskar-makazaga-murua-2013 body:blanes-moan-2002",
        "free top and gravity kicks, generalised order (10, 6, 4), 8 forces"),
    "aba-10-4": Splitting(
        drift_first(
            4,
            (0.04706710064597250612947887637243678556564, 0.1847569354170881069247376193702960568574,
             0.2827060056798362053243616565541452479160),
            (0.1188819173681970199453503950853885936957, 0.2410504605515015657441667865901651105675,
             -0.2732866667053238060543113981664559460630)),
        "blanes-casas-farres-laskar-makazaga-murua-2013 body:blanes-moan-2002",
        "free top and gravity kicks, generalised order (10, 4), 7 forces"),
}
# fmt: on
