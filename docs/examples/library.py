"""Three ways through the library: a scene, a scene in a basis, and matrices of one's own."""

import numpy as np

import uplift

# A scene with a value changed, in all dofs and in a Krylov basis.
scene = uplift.read_scene("drivers/scenes/sdls119a.toml").with_("load.amplitude", 4.0).with_("supports.mass", 0.0)
with uplift.assemble(scene) as model:
    whole = uplift.transient(model, step=0.005, steps=600)
    with uplift.project(model, uplift.krylov_basis(model, tolerance=1e-8)) as small:
        reduced = uplift.transient(small, step=0.005, steps=600)
        swept = uplift.time_frequency(small, step=0.005, steps=600)
peak = np.abs(whole["P3.DX"]).max()
print(f"largest P3.DX {peak:.5f} {whole.units['P3.DX']}, {small.n} vectors for {model.n} dofs")
apart = [np.abs(other["P3.DX"] - whole["P3.DX"]).max() / peak for other in (reduced, swept)]
print(f"in the basis {apart[0]:.0e} off, swept {apart[1]:.0e}")

# A block of 1,000 kg on two one-sided springs, its rocking and heave, shaken sideways by a sine.
mass, half_width, height, k = 1000.0, 1.0, 1.5, 1e7
inertia = mass * (half_width**2 + height**2) / 3 + mass * height**2
weight, shaking = np.array([-9.81 * mass, 0.0]), np.array([0.0, mass * height])
push = np.array([[1.0, 1.0], [-half_width, half_width]])  # heave and rocking under 1 N of compression in either spring
block = uplift.from_matrices(
    np.zeros((2, 2)), np.diag([mass, inertia]), loads=[(weight, 1.0), (shaking, lambda t: 8.0 * np.sin(2 * np.pi * 2.0 * t))],
    contacts=uplift.contacts(push, k), probes={"heave": [1.0, 0.0], "rocking": [0.0, 1.0]},
)
with block:
    rocking = uplift.transient(block, uplift.generalised_alpha(0.8), step=1e-3, steps=2000)
print(f"largest rotation {np.abs(rocking['rocking']).max():.4f} rad, largest gap {rocking['c1 gap'].max():.4f} {rocking.units['c1 gap']}")
