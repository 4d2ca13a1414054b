"""Friction that changes in time, after a jump of the velocity or under any loading history.

Read `velocity_jump` first: from steady state to steady state (`ends`) by the `march` of the depth, which asks
`contact_search` who touches and `free_flight` what the others do. By bounds of the `recent` depths `contact_loss` says
where they may overtake a patch, and `clearance` which cells rest until the line has come nearer. `patches` are the
pieces in contact, `curve` joins the moments. `accuracy` chooses the grids and knows the errors. `elements` follows
every element: slower, but for any history, solid and body.
"""
