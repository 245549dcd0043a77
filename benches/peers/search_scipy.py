"""The search for plans against SciPy's multi-start SLSQP, on the problem of Klimchik et al. 2012.

SciPy gets the same problem: the 5 m angles of joints 2 to 6 (joint 1 does not matter under a vertical
load), the joint limits, the bounds of Table 3 as constraints, and rho0 (eq. 20) with its exact gradient. The
objective and the constraints are this script's own, written in C and compiled at start, so that Python's
slowness does not count; the C code is checked against the five plans of Table 4 and against differences. Every
core runs its own starts, from random feasible plans. Starting Python and compiling do not count either.

With --differences SciPy gets the compiled objective and constraints alone, and takes their derivatives by
differences, its default.

SciPy's time is that until its best plan comes within 0.1 % of the rho0 that elastocal found. elastocal's is that
of the whole process `elastocal plan --json`, which does not know any target, and which also searches the
certificate that no plan of as many measurements can be better.
"""

import argparse
import ctypes
import json
import math
import multiprocessing
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# One start to a core: no threads inside.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
import scipy
from scipy.optimize import minimize

ROOT = Path(__file__).resolve().parents[2]
LIMITS_DEG = np.array([[-146, 0], [-119, 155], [-350, 350], [-125, 125], [-350, 350]])
# What elastocal evaluates the plans of Table 4 to (um), see tests/it/search.rs.
TABLE_4_UM = {2: 8.1716, 3: 6.5882, 4: 5.4528, 6: 4.5287, 12: 3.2002}

SOURCE = r"""
#include <math.h>
#define P 5

static const double FORCE = 2500, SIGMA = 30;   /* N; um */
static const double CALIBRATION[3] = {0.6115, 0, -0.460}, MACHINING[3] = {0.986, 0, 0};
static double weights[P][P];                     /* A_0^T A_0 in (m N m)^2 */

static void cross(const double *a, const double *b, double *c) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}
static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* r := r R(axis k, angle); moves along the columns: o := o + r t */
static void turn(double r[3][3], int k, double angle) {
    int i = (k + 1) % 3, j = (k + 2) % 3, n;
    double c = cos(angle), s = sin(angle);
    for (n = 0; n < 3; n++) {
        double a = r[n][i], b = r[n][j];
        r[n][i] = a * c + b * s;
        r[n][j] = b * c - a * s;
    }
}
static void move(double r[3][3], double *o, double x, double y, double z) {
    int n;
    for (n = 0; n < 3; n++) o[n] += r[n][0] * x + r[n][1] * y + r[n][2] * z;
}

/* Axes z_n, position columns J_n of joints 2 to 6, tool position and its z axis, at q2..q6 with q1 = 0. */
static void chain(const double *q, const double *tool, double z[P][3], double J[P][3], double *p, double *up) {
    static const int about[P] = {1, 1, 0, 1, 0};
    static const double sign[P] = {1, 1, -1, 1, -1};
    double r[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, anchor[P][3], o[3] = {0, 0, 0}, arm[3];
    int n, i;
    move(r, o, 0.350, 0, 0.750);
    for (n = 0; n < P; n++) {
        for (i = 0; i < 3; i++) { z[n][i] = sign[n] * r[i][about[n]]; anchor[n][i] = o[i]; }
        turn(r, about[n], sign[n] * q[n]);
        if (n == 0) move(r, o, 1.250, 0, 0);
        if (n == 1) move(r, o, 1.100, 0, -0.055);
    }
    move(r, o, tool[0], tool[1], tool[2]);
    for (i = 0; i < 3; i++) { p[i] = o[i]; up[i] = r[i][2]; }
    for (n = 0; n < P; n++) {
        for (i = 0; i < 3; i++) arm[i] = p[i] - anchor[n][i];
        cross(z[n], arm, J[n]);
    }
}

/* Eq. 23: the test pose of Table 2. */
void prepare(void) {
    const double q[P] = {-56.9 * M_PI / 180, 89.3 * M_PI / 180, 45.1 * M_PI / 180, 76 * M_PI / 180, 57.2 * M_PI / 180};
    const double f[3] = {0, 280, -180};
    double z[P][3], J[P][3], p[3], up[3];
    int a, b;
    chain(q, MACHINING, z, J, p, up);
    for (a = 0; a < P; a++)
        for (b = 0; b < P; b++) weights[a][b] = dot(J[a], J[b]) * dot(J[a], f) * dot(J[b], f);
}

/* rho0^2 (um^2) of m experiments and its gradient (5 m); infinite for a singular plan. */
double objective(int m, const double *q, double *gradient) {
    double z[12][P][3], J[12][P][3], t[12][P], p[3], up[3];
    double M[P][P] = {{0}}, L[P][P], X[P][P], G[P][P], cost = 0;
    int e, a, b, c, n, i;
    for (e = 0; e < m; e++) {
        chain(q + P * e, CALIBRATION, z[e], J[e], p, up);
        for (a = 0; a < P; a++) t[e][a] = -FORCE * J[e][a][2];
        for (a = 0; a < P; a++)
            for (b = 0; b <= a; b++) M[a][b] += dot(J[e][a], J[e][b]) * t[e][a] * t[e][b];
    }
    for (a = 0; a < P; a++)
        for (b = 0; b <= a; b++) {
            double sum = M[a][b];
            for (c = 0; c < b; c++) sum -= L[a][c] * L[b][c];
            if (a == b) {
                if (!(sum > 1e-12 * M[a][a])) return INFINITY;
                L[a][a] = sqrt(sum);
            } else L[a][b] = sum / L[b][b];
        }
    /* X = M^-1 W, G = X M^-1 */
    for (b = 0; b < P; b++) {
        double y[P];
        for (a = 0; a < P; a++) { y[a] = weights[a][b]; for (c = 0; c < a; c++) y[a] -= L[a][c] * y[c]; y[a] /= L[a][a]; }
        for (a = P - 1; a >= 0; a--) { for (c = a + 1; c < P; c++) y[a] -= L[c][a] * y[c]; y[a] /= L[a][a]; X[a][b] = y[a]; }
        cost += X[b][b];
    }
    for (b = 0; b < P; b++) {
        double y[P];
        for (a = 0; a < P; a++) { y[a] = X[b][a]; for (c = 0; c < a; c++) y[a] -= L[a][c] * y[c]; y[a] /= L[a][a]; }
        for (a = P - 1; a >= 0; a--) { for (c = a + 1; c < P; c++) y[a] -= L[c][a] * y[c]; y[a] /= L[a][a]; G[b][a] = y[a]; }
    }
    for (e = 0; e < m; e++) {
        double v[P][3], along[P];
        for (a = 0; a < P; a++) {
            double B[3] = {0, 0, 0};   /* column a of -2 A G */
            for (b = 0; b < P; b++)
                for (i = 0; i < 3; i++) B[i] -= 2 * J[e][b][i] * t[e][b] * G[b][a];
            along[a] = dot(B, J[e][a]);
            for (i = 0; i < 3; i++) v[a][i] = t[e][a] * B[i];
            v[a][2] -= FORCE * along[a];
        }
        for (n = 0; n < P; n++) {
            double sum = 0, d[3];
            for (a = 0; a < P; a++) {   /* dJ_a/dq_n */
                if (n <= a) cross(z[e][n], J[e][a], d);
                else cross(z[e][a], J[e][n], d);
                sum += dot(v[a], d);
            }
            gradient[P * e + n] = SIGMA * SIGMA * sum;
        }
    }
    return SIGMA * SIGMA * cost;
}

/* The bounds of Table 3, 4 to an experiment, positive inside; jacobian 4 m x 5 m, row by row. */
void constraints(int m, const double *q, double *values, double *jacobian) {
    int e, n;
    for (e = 0; e < m; e++) {
        double z[P][3], J[P][3], p[3], up[3], r, d[3];
        chain(q + P * e, CALIBRATION, z, J, p, up);
        r = hypot(p[0], p[1]);
        values[4 * e] = p[2] - 0.8;
        values[4 * e + 1] = r - 0.6;
        values[4 * e + 2] = 0.5 - up[2];
        values[4 * e + 3] = 0.5 + up[2];
        if (!jacobian) continue;
        for (n = 0; n < P; n++) {
            double *row = jacobian + 4 * e * P * m + P * e + n;
            cross(z[n], up, d);
            row[0] = J[n][2];
            row[P * m] = (p[0] * J[n][0] + p[1] * J[n][1]) / r;
            row[2 * P * m] = -d[2];
            row[3 * P * m] = d[2];
        }
    }
}
"""


class Problem:
    """The compiled problem for m experiments."""

    def __init__(self, library, m, differences=False):
        self.m = m
        self.differences = differences
        self.library = ctypes.CDLL(str(library))
        doubles = ctypes.POINTER(ctypes.c_double)
        self.library.objective.restype = ctypes.c_double
        self.library.objective.argtypes = [ctypes.c_int, doubles, doubles]
        self.library.constraints.restype = None
        self.library.constraints.argtypes = [ctypes.c_int, doubles, doubles, doubles]
        self.library.prepare()
        low, high = np.radians(LIMITS_DEG).T
        self.low, self.high = np.tile(low, m), np.tile(high, m)

    @staticmethod
    def _at(array):
        return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

    def objective(self, q):
        q, gradient = np.ascontiguousarray(q), np.empty(5 * self.m)
        return self.library.objective(self.m, self._at(q), self._at(gradient)), gradient

    def cost(self, q):
        return self.objective(q)[0]

    def constraints(self, q):
        q, values = np.ascontiguousarray(q), np.empty(4 * self.m)
        self.library.constraints(self.m, self._at(q), self._at(values), None)
        return values

    def jacobian(self, q):
        q, values = np.ascontiguousarray(q), np.empty(4 * self.m)
        jacobian = np.zeros((4 * self.m, 5 * self.m))
        self.library.constraints(self.m, self._at(q), self._at(values), self._at(jacobian))
        return jacobian

    def draw(self, random):
        """A random feasible plan."""
        one = Problem.__new__(Problem)
        one.m, one.library = 1, self.library
        experiments = []
        while len(experiments) < self.m:
            q = random.uniform(self.low[:5], self.high[:5])
            if one.constraints(q).min() >= 0:
                experiments.append(q)
        return np.concatenate(experiments)

    def search(self, seed):
        """One start: rho0 (um) where it ends, infinite where that is not feasible."""
        start = self.draw(np.random.default_rng(seed))
        constraints = {"type": "ineq", "fun": self.constraints}
        if not self.differences:
            constraints["jac"] = self.jacobian
        result = minimize(
            self.cost if self.differences else self.objective,
            start,
            jac=not self.differences,
            method="SLSQP",
            bounds=list(zip(self.low, self.high)),
            constraints=constraints,
            options={"ftol": 1e-8, "maxiter": 500},
        )
        q = np.clip(result.x, self.low, self.high)
        value, _ = self.objective(q)
        feasible = self.constraints(q).min() > -1e-6
        return math.sqrt(value) if feasible and value > 0 else math.inf


def compiled(folder):
    source, library = Path(folder) / "problem.c", Path(folder) / "problem.so"
    source.write_text(SOURCE)
    compiler = os.environ.get("CC", "cc")
    command = [compiler, "-O3", "-march=native", "-shared", "-fPIC", source, "-o", library, "-lm"]
    subprocess.run(command, check=True)
    return library


def read_plan(m):
    rows = []
    for line in (ROOT / f"scenarios/plans/klimchik2012_m{m}.csv").read_text().splitlines():
        if line and (line[0].isdigit() or line[0] == "-"):
            rows.append([float(field) for field in line.split(",")[1:6]])
    return np.radians(np.array(rows)).ravel()


def check(library):
    """The script's own kinematics give Table 4's values, and its gradients are those of differences."""
    for m, expected in TABLE_4_UM.items():
        problem, q = Problem(library, m), read_plan(m)
        found = math.sqrt(problem.objective(q)[0])
        assert abs(found / expected - 1) < 2e-5, f"m = {m}: {found} um, expected {expected}"
        step = 1e-6 * np.eye(5 * m)
        _, gradient = problem.objective(q)
        by_differences = [
            (problem.objective(q + one)[0] - problem.objective(q - one)[0]) / 2e-6 for one in step
        ]
        assert np.allclose(gradient, by_differences, rtol=1e-5, atol=1e-5 * abs(gradient).max())
        by_differences = np.transpose(
            [(problem.constraints(q + one) - problem.constraints(q - one)) / 2e-6 for one in step]
        )
        assert np.allclose(problem.jacobian(q), by_differences, atol=1e-8)


def ours(m, seed):
    """rho0 (um), efficiency, the time of the whole process (s), and the number of its starts."""
    command = [ROOT / "target/release/elastocal", "plan", ROOT / "scenarios/klimchik2012.toml"]
    command += ["--experiments", str(m), "--seed", str(seed), "--json", "--quiet"]
    start = time.perf_counter()
    result = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    elapsed = time.perf_counter() - start
    assert result["violations"] == []
    return result["rho0_mm"] * 1e3, result["efficiency"], elapsed, result["searches"]


worker = None


def begin(library, m, differences):
    global worker
    worker = Problem(library, m, differences)


def start_from(seed):
    return worker.search(seed)


def scipys(library, m, target, limit_s, seed, processes, differences=False):
    """Searches until the target is met or the time is over."""
    with multiprocessing.Pool(processes, begin, (library, m, differences)) as pool:
        pool.map(abs, range(processes))
        begun, best, starts = time.perf_counter(), math.inf, 0
        reached = None
        for value in pool.imap_unordered(start_from, ((seed, index) for index in range(10**9))):
            starts += 1
            best = min(best, value)
            elapsed = time.perf_counter() - begun
            if best <= target:
                reached = elapsed
                break
            if elapsed > limit_s:
                break
        pool.terminate()
    return {"reached_s": reached, "searched_s": elapsed, "best_um": best, "starts": starts}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--experiments", type=int, nargs="+", default=list(TABLE_4_UM))
    parser.add_argument("--repetitions", type=int, default=3, help="seeds, for both programs")
    parser.add_argument("--limit", type=float, default=120, help="seconds for one SciPy search")
    parser.add_argument("--differences", action="store_true", help="SciPy gets no derivatives")
    parser.add_argument("--json", type=Path, default=ROOT / "out/search_scipy.json")
    arguments = parser.parse_args()
    processes = len(os.sched_getaffinity(0))
    results = []
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(folder)
        check(library)
        print("own kinematics and gradients checked against Table 4")
        for m in arguments.experiments:
            seeds = range(1, arguments.repetitions + 1)
            found = [ours(m, seed) for seed in seeds]
            rho0, efficiency, *_ = min(found)
            peers = []
            for seed in seeds:
                target = rho0 * 1.001
                peers.append(
                    scipys(library, m, target, arguments.limit, seed, processes, arguments.differences)
                )
                print(f"m = {m}, seed {seed}: {peers[-1]}", file=sys.stderr)
            # A search that did not reach the target took longer than the limit.
            times = [peer["reached_s"] or math.inf for peer in peers]
            results.append(
                {
                    "experiments": m,
                    "elastocal_rho0_um": rho0,
                    "elastocal_efficiency": efficiency,
                    "elastocal_s": [elapsed for _, _, elapsed, _ in found],
                    "elastocal_starts": found[0][3],
                    "elastocal_median_s": statistics.median(e for _, _, e, _ in found),
                    "scipy": peers,
                    "scipy_median_s": None if math.isinf(t := statistics.median(times)) else t,
                }
            )
    report(results, arguments, processes)


def report(results, arguments, processes):
    print(f"\n{processes} cores, {platform.machine()}; SciPy {scipy.__version__}; {arguments.repetitions} seeds, medians; derivatives {'by differences' if arguments.differences else 'exact, compiled'}")
    print(f"{'m':>3} {'elastocal':>10} {'effic.':>7} {'time':>8} {'starts':>6} {'SciPy to within 0.1 %':>34} {'a start':>8} {'ratio':>8}")
    for each in results:
        ours_s, peer_s = each["elastocal_median_s"], each["scipy_median_s"]
        best = statistics.median(peer["best_um"] for peer in each["scipy"])
        if peer_s is None:
            gap = (best / each["elastocal_rho0_um"] - 1) * 100
            theirs = f"not in {arguments.limit:.0f} s: {best:.4f} um, +{gap:.2f} %"
            ratio = f"> {arguments.limit / ours_s:.1f}"
        else:
            starts = statistics.median(peer["starts"] for peer in each["scipy"])
            theirs, ratio = f"{peer_s:.2f} s, {starts:.0f} starts", f"{peer_s / ours_s:.2f}"
        searched_s = sum(peer["searched_s"] for peer in each["scipy"])
        a_start_ms = 1e3 * searched_s / sum(peer["starts"] for peer in each["scipy"])
        print(
            f"{each['experiments']:>3} {each['elastocal_rho0_um']:>7.4f} um "
            f"{each['elastocal_efficiency']:>7.4f} {ours_s:>6.2f} s {each['elastocal_starts']:>6} "
            f"{theirs:>34} {a_start_ms:>5.1f} ms {ratio:>8}"
        )
    together_s = sum(each["elastocal_median_s"] for each in results)
    scipy_s = sum(each["scipy_median_s"] or arguments.limit for each in results)
    more = ">" if any(each["scipy_median_s"] is None for each in results) else ""
    print(f"together {together_s:.2f} s, SciPy {more} {scipy_s:.1f} s, ratio {more} {scipy_s / together_s:.1f}")
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    record = {
        "cores": processes,
        "machine": platform.machine(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "limit_s": arguments.limit,
        "differences": arguments.differences,
        "results": results,
    }
    arguments.json.write_text(json.dumps(record, indent=2) + "\n")
    print(f"wrote {arguments.json}")


if __name__ == "__main__":
    main()
