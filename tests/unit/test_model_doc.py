"""docs/model.md: its table of the published sets against the paper's equations as printed, and against goniofit eval."""
import json
import math
import os
import re
import subprocess
import tempfile
from pathlib import Path

GONIOFIT = Path(os.environ.get("BUILD", "build"), "goniofit")
SETS = {"acrylic": (0.10, 0.35, 0.05, 126, 1.40), "0 %": (0.12, 0.2, 0.2, 15.7, 1.70),
        "60 %": (0.20, 0.3, 0.07, 7.6, 1.70), "90 %": (0.30, 0.5, 0.08, 1.6, 2.42)}


def printed(s_paper, sigma, gamma, beta_prime, n, i_deg, v_deg):
    """Equations 2 to 5 with N, L, V and Q as vectors; S enters as the paper has it, divided by pi."""
    i, r, c = math.radians(i_deg), math.radians(abs(v_deg)), -1 if v_deg > 0 else 1
    alpha, beta, s2 = max(i, r), min(i, r), sigma ** 2
    c1 = 1 - 0.5 * s2 / (s2 + 0.33)
    c2 = 0.45 * s2 / (s2 + 0.09) * (math.sin(alpha) - (0 if c > 0 else (2 * beta / math.pi) ** 3))
    direct = s_paper / math.pi * (c1 + c * c2 * math.tan(beta))
    indirect = 0.17 * s_paper ** 2 / math.pi * s2 / (s2 + 0.13) * (1 - c * (2 * beta / math.pi) ** 2)
    light, view = (-math.sin(i), math.cos(i)), (-c * math.sin(r), math.cos(r))
    length = math.hypot(light[0] + view[0], light[1] + view[1])
    facet = ((light[0] + view[0]) / length, (light[1] + view[1]) / length)
    v_q = view[0] * facet[0] + view[1] * facet[1]
    shadow = min(1, 2 * facet[1] * view[1] / v_q, 2 * facet[1] * light[1] / v_q)
    g = math.sqrt(n * n + v_q * v_q - 1)
    fresnel = 0.5 * ((g - v_q) / (g + v_q)) ** 2 * (1 + ((v_q * (g + v_q) - 1) / (v_q * (g - v_q) + 1)) ** 2)
    lobe = math.exp(-math.log(2) * math.acos(min(1, facet[1])) ** 2 / gamma ** 2)
    return direct + indirect + beta_prime * lobe * shadow * fresnel / (light[1] * view[1])


def evaluated(folder, set_, kappa, i_deg, v_deg):
    names = ("S", "sigma", "gamma", "beta_prime", "n")
    (folder / "p.json").write_text(json.dumps(dict(zip(names, set_), kappa=kappa)))
    (folder / "g.csv").write_text(f"theta_i_deg,theta_v_deg\n{i_deg},{v_deg}\n")
    out = subprocess.run([GONIOFIT, "eval", "--params", folder / "p.json", "--points", folder / "g.csv"],
                         capture_output=True, text=True, check=True, timeout=300).stdout
    return float(out.splitlines()[1].split(",")[2])


def rows():
    number = r"\s*(-?[\d.]+)\s*"
    row = re.compile(r"^\|\s*(acrylic|\d+ %)\s*\|" + r"\|".join([number] * 4) + r"\|$", re.M)
    return [(m[1], *map(float, m.groups()[1:])) for m in row.finditer(Path("docs/model.md").read_text())]


def test_table_of_published_sets(folder):
    found = rows()
    assert {row[0] for row in found} == set(SETS) and len(found) >= 12
    for name, i_deg, v_deg, as_printed, as_goniod in found:
        set_ = SETS[name]
        expected = printed(math.pi * set_[0], *set_[1:], i_deg, v_deg)
        assert abs(expected - as_printed) <= 5.1e-6, (name, i_deg, v_deg, expected)
        assert abs(evaluated(folder, set_, math.pi, i_deg, v_deg) - expected) <= 1e-12 * expected
        assert abs(evaluated(folder, set_, 1, i_deg, v_deg) - as_goniod) <= 5.1e-6, (name, i_deg, v_deg)


def main():
    print("1..1")
    try:
        with tempfile.TemporaryDirectory() as folder:
            test_table_of_published_sets(Path(folder))
        print("ok 1 test_table_of_published_sets")
    except Exception as e:
        print(f"not ok 1 test_table_of_published_sets\n# {type(e).__name__}: {e}", flush=True)


if __name__ == "__main__":
    main()
