"""The search for a certified plan, as a whole process, beside SciPy's multi-start search and FIGAROH's selections; and the
proof of the bound beside SCIP."""

import math
import tempfile
import time
from multiprocessing import cpu_count

from timing import Result


def beside_scipy(limit_s: float, seeds: int) -> list[Result]:
    """See search_scipy.py for what the two do and when SciPy is stopped."""
    import search_scipy as scipy

    results = []
    with tempfile.TemporaryDirectory() as folder:
        library = scipy.compiled(folder)
        scipy.check(library)
        for m in [3, 12]:
            target = 1.001 * min(scipy.ours(m, seed)[0] for seed in range(1, seeds + 1))
            result = Result(f"search to a certified plan, m = {m}", "SciPy SLSQP, told when to stop")
            for seed in range(1, seeds + 1):
                result.ours_s.append(scipy.ours(m, seed)[2])
                peer = scipy.scipys(library, m, target, limit_s, seed, cpu_count())
                result.at_least |= peer["reached_s"] is None
                result.peer_s.append(peer["reached_s"] or peer["searched_s"])
            result.note = f"to within 0.1 % of {target / 1.001:.3f} um"
            results.append(result)
    return results


def beside_figaroh(problem: dict, seeds: int) -> list[Result]:
    import search_scipy as scipy
    from select_figaroh import EXPERIMENTS, selections

    results = []
    pool, ways = selections(problem)
    for name, select in ways:
        result = Result(f"selection of {EXPERIMENTS} from a pool of {len(pool.information)}", name)
        best = ours_best = math.inf
        try:
            for seed in range(1, seeds + 1):
                rho0, _, elapsed, _ = scipy.ours(EXPERIMENTS, seed)
                start = time.perf_counter()
                best = min(best, pool.rho0_um(select(seed)))
                result.peer_s.append(time.perf_counter() - start)
                result.ours_s.append(elapsed)
                ours_best = min(ours_best, rho0)
            result.note = f"rho0 {best:.2f} um; elastocal, from the whole region, {ours_best:.2f} um"
        except (TimeoutError, ArithmeticError) as error:
            result.skipped = str(error)
        results.append(result)
    return results


def beside_scip(limit_s: float) -> list[Result]:
    """See prove_scip.py for what SCIP is given."""
    import prove_scip

    return prove_scip.beside_scip(limit_s)
