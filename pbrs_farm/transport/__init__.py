"""Light: path tracing and Metropolis, denoising and tone; only here and in raycast mitsuba and drjit.

Effects: passes the path of LLVM's library to Dr.Jit, which the modules below import.

light_scene.py is the entry point: a house is loaded once and rendered view by view. view_emitters.py prepares
its emitters for each view; pilot.py and lampshade_exitance.py take the measurements that a view or a house
needs first. scene_tables/ holds the house as flat tables: skies, textures, materials, portals. kernels/ has
one step of a path (path_step.py, direct_light.py, shadow_roulette.py, bsdf.py), the choice of lamps, sun, sky
and windows by position (emitters.py, outdoor_choice.py, arrival_rates.py, lamp_guiding.py), sunlit points and
guided rays. path_tracer.py and metropolis/ are the integrators; sample_passes.py and surface_noise.py are the
passes of the first and its noise in films. develop/ denoises, white-balances and tone-maps; lamp_layers.py and
illuminance.py are light by lamp and lux on floors; validation/ has rooms with known answers.
docs/light_methods.md explains them.
"""

from pbrs_farm.raycast.variant import name_libraries

name_libraries()
