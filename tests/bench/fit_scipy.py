"""scipy's least_squares on a case of goniofit bench: fit_scipy.py CASE.csv REPEATS. Prints records (fit/bench_run.h)."""
import sys
import time
from statistics import median

import numpy as np
import scipy
from scipy.optimize import least_squares

LN2 = np.log(2)


def fresnel(n, c, s2):
    q = np.sqrt(n * n - 1 + c * c)
    g = q + c
    rs = ((n * n - 1) / g**2) ** 2
    t = (c * q - s2) / (c * q + s2)
    rs1 = 2 * rs * (2 * n / (n * n - 1) - 2 * n / (q * g))
    t1 = 2 * s2 * c * (n / q) / (c * q + s2) ** 2
    return rs * (1 + t * t) / 2, rs1 * (1 + t * t) / 2 + rs * t * t1


class Case:
    """The composite model in (ln S, ln sigma, ln gamma, ln A45, ln(n - 1)), every array expression over all points."""

    def __init__(self, path):
        start = {}
        for line in open(path):
            if line.startswith("# "):
                name, *numbers = line[2:].split()
                start[name] = np.array([float(x) for x in numbers])
        self.start, self.warm = start["start"], start["warm"]
        i_deg, v_deg, self.beta, u = np.loadtxt(path, delimiter=",", skiprows=3, unpack=True)
        self.w = 1 / u
        i, r, c = np.radians(i_deg), np.radians(abs(v_deg)), np.where(v_deg > 0, -1, 1)
        high, low = np.maximum(i, r), np.minimum(i, r)
        ratio = 2 * low / np.pi
        self.phi, q = np.radians(abs(i_deg - v_deg)) / 2, np.radians(abs(i_deg + v_deg)) / 2
        g = np.minimum(1, 2 * np.cos(self.phi) / np.cos(q) * np.minimum(np.cos(i), np.cos(r)))
        self.c, self.s2, self.visible = np.cos(q), np.sin(q) ** 2, g / np.cos(i) / np.cos(r)
        self.direct = c * 0.45 * (np.sin(high) - np.where(c < 0, ratio**3, 0)) * np.tan(low)
        self.inter = 0.17 * (1 - c * ratio**2)

    def parts(self, x):
        s, s2, gamma, a, n = np.exp(x[0]), np.exp(2 * x[1]), np.exp(x[2]), np.exp(x[3]), 1 + np.exp(x[4])
        f45, slope45 = fresnel(n, np.sqrt(0.5), 0.5)
        f, slope = fresnel(n, self.c, self.s2)
        ln_d = -LN2 * (self.phi / gamma) ** 2
        lobe = a / f45 * np.exp(ln_d) * self.visible
        return s, s2, ln_d, lobe, f, slope - f * slope45 / f45, n

    def residuals(self, x):
        s, s2, _, lobe, f, _, _ = self.parts(x)
        h, k, j = s2 / (s2 + 0.33), s2 / (s2 + 0.09), s2 / (s2 + 0.13)
        return (s * (1 - h / 2 + k * self.direct) + s * s * j * self.inter + lobe * f - self.beta) * self.w

    def jacobian(self, x):
        s, s2, ln_d, lobe, f, slope, n = self.parts(x)
        h, k, j = s2 / (s2 + 0.33), s2 / (s2 + 0.09), s2 / (s2 + 0.13)
        h1, k1, j1 = (2 * s2 * a / (s2 + a) ** 2 for a in (0.33, 0.09, 0.13))
        columns = [s * (1 - h / 2 + k * self.direct) + 2 * s * s * j * self.inter,
                   s * (k1 * self.direct - h1 / 2) + s * s * j1 * self.inter,
                   -2 * ln_d * lobe * f, lobe * f, lobe * slope * (n - 1)]
        return np.column_stack(columns) * self.w[:, None]


def main():
    case, repeats = Case(sys.argv[1]), min(int(sys.argv[2]), 31)
    print(f"# scipy {scipy.__version__}")
    for method in ("lm", "trf"):
        for what, start in (("cold", case.start), ("warm", case.warm)):
            times = []
            for _ in range(repeats):
                begun = time.perf_counter()
                found = least_squares(case.residuals, start, case.jacobian, method=method, xtol=1e-10, ftol=1e-10,
                                      gtol=1e-10)
                times.append(1e6 * (time.perf_counter() - begun))
            numbers = ",".join(f"{v:.17g}" for v in found.x)
            print(f"scipy {method},numpy,{what},{median(times):.4f},{2 * found.cost:.17g},{found.nfev},{numbers}")


main()
