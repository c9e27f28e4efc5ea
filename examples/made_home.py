"""A generated and dressed flat with two bedrooms."""

import pbrs_farm as pf

home = pf.make(7, rooms="1..2", furniture="none", recipe="preview")
print(home.rooms)
pf.render(home, home.cameras(n=1), modes=["opengl_dl"]).save("out/made_home")
