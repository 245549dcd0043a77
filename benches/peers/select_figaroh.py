"""Selection of experiments from a pool by FIGAROH's own SOCP and exchange (D-optimal), scored by rho0.

FIGAROH chooses from 200 random feasible experiments and gets their information matrices ready-made, each
column of the observation matrices scaled to length one on average (otherwise its solver fails). It maximises
the determinant; rho0 is what its choice means at the test pose.
"""

import math
import random
import time

import numpy as np
from figaroh.optimal.base_optimal_calibration import Detmax, SOCPOptimizer

from objective_numpy import test_pose_matrix

EXPERIMENTS = 12
LIMIT_S = 20.0


class Watched(Detmax):
    """Remembers the set that it looked at last (its own is lost when it ends), and ends in time."""

    def get_critD(self, chosen):
        if time.perf_counter() > self.deadline:
            raise TimeoutError(f"no end after {LIMIT_S:.0f} s")
        self.latest = list(chosen)
        return super().get_critD(chosen)


class Pool:
    def __init__(self, problem: dict):
        self.matrices = np.array(problem["pool"]["observation_matrices"])
        typical = np.array(problem["compliance_rad_per_nm"])[problem["parameters"]]
        self.test_pose = test_pose_matrix(problem) * typical
        scaled = self.matrices / np.sqrt((self.matrices**2).mean(axis=(0, 1)))
        self.information = {index: matrix.T @ matrix for index, matrix in enumerate(scaled)}

    def rho0_um(self, weights) -> float:
        information = np.einsum("e,eki,ekj->ij", weights, self.matrices, self.matrices)
        covariance = np.linalg.inv(information)
        return 1e6 * math.sqrt(np.trace(self.test_pose @ covariance @ self.test_pose.T))

    def socp(self, _seed: int) -> np.ndarray:
        """The weights of the SOCP, rounded to so many measurements by largest remainders."""
        size = len(self.information)
        weights, _ = SOCPOptimizer(self.information, {"NbSample": size}).solve()
        shares = EXPERIMENTS * np.array(weights) / sum(weights)
        repeats = np.floor(shares)
        rest = EXPERIMENTS - int(repeats.sum())
        repeats[np.argsort(repeats - shares)[:rest]] += 1
        return repeats

    def exchange(self, seed: int) -> np.ndarray:
        random.seed(seed)
        search = Watched(self.information, EXPERIMENTS)
        search.deadline = time.perf_counter() + LIMIT_S
        search.main_algo()
        return np.bincount(search.latest, minlength=len(self.information))


def selections(problem: dict):
    """Each way to select: its name, and a function from a seed to the repeats of each experiment."""
    pool = Pool(problem)
    return pool, [("FIGAROH, SOCP", pool.socp), ("FIGAROH, exchange", pool.exchange)]
