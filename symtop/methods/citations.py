"""BibTeX entries of the methods, by the keys that the registry uses."""

from symtop.base.validate import SymtopError
from symtop.methods.registry import Integrator, integrator


def _article(author: str, title: str, journal: str, volume: str, pages: str, year: int) -> tuple[str, dict[str, str]]:
    return "article", {
        "author": author, "title": title, "journal": journal, "volume": volume, "pages": pages, "year": str(year),
    }  # fmt: skip


def _book(author: str, title: str, publisher: str, year: int, **more: str) -> tuple[str, dict[str, str]]:
    return "book", {"author": author, "title": title, "publisher": publisher, "year": str(year), **more}


def _chapter(
    author: str, title: str, booktitle: str, publisher: str, pages: str, year: int, **more: str
) -> tuple[str, dict[str, str]]:
    return "incollection", {
        "author": author, "title": title, "booktitle": booktitle, "publisher": publisher, "pages": pages,
        "year": str(year), **more,
    }  # fmt: skip


ENTRIES: dict[str, tuple[str, dict[str, str]]] = {
    "klein-sommerfeld-1910": _book(
        "Klein, F. and Sommerfeld, A.",
        r"{\"U}ber die {T}heorie des {K}reisels",
        "Teubner",
        1910,
        note="first part 1897",
    ),
    "hairer-mclachlan-razakarivony-2008": _article(
        "Hairer, E. and McLachlan, R. I. and Razakarivony, A.",
        "Achieving {B}rouwer's law with implicit {R}unge--{K}utta methods",
        "BIT Numerical Mathematics",
        "48",
        "231--243",
        2008,
    ),
    "marsden-west-2001": _article(
        "Marsden, J. E. and West, M.",
        "Discrete mechanics and variational integrators",
        "Acta Numerica",
        "10",
        "357--514",
        2001,
    ),
    "hairer-lubich-wanner-2003": _article(
        "Hairer, E. and Lubich, C. and Wanner, G.",
        r"Geometric numerical integration illustrated by the {St\"ormer--Verlet} method",
        "Acta Numerica",
        "12",
        "399--450",
        2003,
    ),
    "touma-wisdom-1994": _article(
        "Touma, J. and Wisdom, J.",
        "{Lie--Poisson} integrators for rigid body dynamics in the solar system",
        "The Astronomical Journal",
        "107",
        "1189--1202",
        1994,
    ),
    "bobenko-suris-1999": _article(
        "Bobenko, A. I. and Suris, Yu. B.",
        "Discrete time {Lagrangian} mechanics on {Lie} groups, with an application to the {Lagrange} top",
        "Communications in Mathematical Physics",
        "204",
        "147--188",
        1999,
    ),
    "takahashi-imada-1984": _article(
        "Takahashi, M. and Imada, M.",
        "{Monte Carlo} calculation of quantum systems. {II}. {Higher} order correction",
        "Journal of the Physical Society of Japan",
        "53",
        "3765--3769",
        1984,
    ),
    "chin-1997": _article(
        "Chin, S. A.",
        "Symplectic integrators from composite operator factorizations",
        "Physics Letters A",
        "226",
        "344--348",
        1997,
    ),
    "yoshida-1990": _article(
        "Yoshida, H.",
        "Construction of higher order symplectic integrators",
        "Physics Letters A",
        "150",
        "262--268",
        1990,
    ),
    "suzuki-1990": _article(
        "Suzuki, M.",
        "Fractal decomposition of exponential operators with applications to many-body theories and {Monte Carlo} "
        "simulations",
        "Physics Letters A",
        "146",
        "319--323",
        1990,
    ),
    "blanes-moan-2002": _article(
        "Blanes, S. and Moan, P. C.",
        r"Practical symplectic partitioned {Runge--Kutta} and {Runge--Kutta--Nystr\"om} methods",
        "Journal of Computational and Applied Mathematics",
        "142",
        "313--330",
        2002,
    ),
    "kahan-li-1997": _article(
        "Kahan, W. and Li, R.-C.",
        "Composition constants for raising the orders of unconventional schemes for ordinary differential equations",
        "Mathematics of Computation",
        "66",
        "1089--1099",
        1997,
    ),
    "suzuki-umeno-1993": _chapter(
        "Suzuki, M. and Umeno, K.",
        "Higher-order decomposition theory of exponential operators and its applications to {QMC} and nonlinear "
        "dynamics",
        "Computer Simulation Studies in Condensed-Matter Physics {VI}",
        "Springer",
        "74--86",
        1993,
        editor='Landau, D. P. and Mon, K. K. and Sch{\\"u}ttler, H.-B.',
    ),
    "sofroniou-spaletta-2005": _article(
        "Sofroniou, M. and Spaletta, G.",
        "Derivation of symmetric composition constants for symmetric integrators",
        "Optimization Methods and Software",
        "20",
        "597--613",
        2005,
    ),
    "blanes-casas-farres-laskar-makazaga-murua-2013": _article(
        r"Blanes, S. and Casas, F. and Farr\'es, A. and Laskar, J. and Makazaga, J. and Murua, A.",
        "New families of symplectic splitting methods for numerical integration in dynamical astronomy",
        "Applied Numerical Mathematics",
        "68",
        "58--72",
        2013,
    ),
    "kutta-1901": _article(
        "Kutta, W.",
        r"Beitrag zur n\"aherungsweisen {Integration} totaler {Differentialgleichungen}",
        r"Zeitschrift f\"ur Mathematik und Physik",
        "46",
        "435--453",
        1901,
    ),
    "butcher-1964": _article(
        "Butcher, J. C.", "Implicit {Runge--Kutta} processes", "Mathematics of Computation", "18", "50--64", 1964
    ),
    "dormand-prince-1980": _article(
        "Dormand, J. R. and Prince, P. J.",
        "A family of embedded {Runge--Kutta} formulae",
        "Journal of Computational and Applied Mathematics",
        "6",
        "19--26",
        1980,
    ),
    "prince-dormand-1981": _article(
        "Prince, P. J. and Dormand, J. R.",
        "High order embedded {Runge--Kutta} formulae",
        "Journal of Computational and Applied Mathematics",
        "7",
        "67--75",
        1981,
    ),
    "hairer-norsett-wanner-1993": _book(
        r"Hairer, E. and N{\o}rsett, S. P. and Wanner, G.",
        "Solving Ordinary Differential Equations {I}: Nonstiff Problems",
        "Springer",
        1993,
        edition="second",
    ),
    "hairer-wanner-1996": _book(
        "Hairer, E. and Wanner, G.",
        "Solving Ordinary Differential Equations {II}: Stiff and Differential-Algebraic Problems",
        "Springer",
        1996,
        edition="second",
    ),
    "hindmarsh-1983": _chapter(
        "Hindmarsh, A. C.",
        "{ODEPACK}, a systematized collection of {ODE} solvers",
        "Scientific Computing",
        "North-Holland",
        "55--64",
        1983,
        editor="Stepleman, R. S.",
    ),
    "petzold-1983": _article(
        "Petzold, L.",
        "Automatic selection of methods for solving stiff and nonstiff systems of ordinary differential equations",
        "SIAM Journal on Scientific and Statistical Computing",
        "4",
        "136--148",
        1983,
    ),
    "biscani-izzo-2021": _article(
        "Biscani, F. and Izzo, D.",
        "Revisiting high-order {Taylor} methods for astrodynamics and celestial mechanics",
        "Monthly Notices of the Royal Astronomical Society",
        "504",
        "2614--2628",
        2021,
    ),
}


def bibtex(key: str) -> str:
    """One entry as BibTeX."""
    kind, fields = ENTRIES[key]
    return "\n".join([f"@{kind}{{{key},", *(f"  {name} = {{{value}}}," for name, value in fields.items()), "}"])


def citation(name: "str | Integrator") -> str:
    """BibTeX of the source of an integrator, by its name.

    Raises SymtopError for an unknown name, or if the integrator names no source that is known here.
    """
    method = integrator(name)
    keys = [key for key in method.reference.replace(",", " ").split() if key in ENTRIES]
    if not keys:
        raise SymtopError(
            f"integrator {method.name!r} names no source that is known here (its reference is {method.reference!r})"
        )
    return "\n\n".join(bibtex(key) for key in keys)
