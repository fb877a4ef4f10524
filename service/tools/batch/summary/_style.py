"""How the page of a summary looks: light and dark, on a desk and on a phone."""

__all__ = ["STYLE"]

STYLE = """
:root { color-scheme: light dark; --ink: #181a1c; --faint: #50565c; --paper: #fff; --line: #ccd0d4;
  --soft: #f2f4f6; --link: #0b57d0; --face: #2f6fb5; --no-face: #b7791f; --unreadable: #7a5bb0;
  --failed: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8eaed; --faint: #a8b0b8; --paper: #16181b;
  --line: #3a4046; --soft: #22262a; --link: #9ec3ff; --face: #6fa8e8; --no-face: #e0ac5a;
  --unreadable: #b59ae6; --failed: #f0857d; } }
* { box-sizing: border-box; }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  margin: 0; }
main { max-width: 72rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; overflow-wrap: anywhere; } h2 { font-size: 1.25rem; margin-top: 2.2rem; }
h3 { font-size: 1.05rem; margin: 1.4rem 0 .3rem; }
small, figcaption, footer { color: var(--faint); font-size: .875rem; font-weight: normal; }
ul { margin: .3rem 0; padding-left: 1.2rem; } li { overflow-wrap: anywhere; }
a { color: var(--link); }
.shares { width: 100%; height: 20px; border-radius: 4px; display: block; }
.face { fill: var(--face); background: var(--face); }
.no_face { fill: var(--no-face); background: var(--no-face); }
.unreadable { fill: var(--unreadable); background: var(--unreadable); }
.failed { fill: var(--failed); background: var(--failed); }
.states { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: .3rem 1.5rem; }
.key { display: inline-block; width: .8rem; height: .8rem; border-radius: 2px; margin-right: .4rem;
  vertical-align: -.05rem; }
.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(9.5rem, 1fr)); gap: .6rem;
  margin: .5rem 0; }
.card { background: var(--soft); border-radius: 6px; padding: .5rem; font-size: .8125rem;
  min-width: 0; overflow-wrap: anywhere; }
.card p { margin: .25rem 0 0; } .card img { height: 112px; display: block; margin: 0 auto; }
img { max-width: 100%; border-radius: 3px; }
.none { color: var(--faint); font-size: .8125rem; }
.scroll { overflow-x: auto; margin: .5rem 0; }
.scroll:focus-visible, a:focus-visible { outline: 2px solid var(--link); outline-offset: 2px; }
table { border-collapse: collapse; font-size: .875rem; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--line); padding: .3rem .6rem; text-align: right;
  vertical-align: middle; white-space: nowrap; }
th { background: var(--soft); } td img { height: 64px; max-width: none; display: block; }
.frames th:first-of-type, .frames td:nth-child(2), .warnings :is(th, td):first-child,
.frames :is(th, td):last-child { text-align: left; }
.frames td:nth-child(2) { min-width: 11rem; max-width: 20rem; white-space: normal;
  overflow-wrap: anywhere; }
.frames td:last-child, .warnings td:first-child { white-space: normal; min-width: 14rem; }
.figures { display: grid; gap: 1rem;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); }
figure { margin: 0; } figure svg { width: 100%; height: auto; }
.bar { fill: var(--face); } line { stroke: var(--line); }
text { fill: var(--faint); font: 15px system-ui, sans-serif; }
footer { margin-top: 2rem; border-top: 1px solid var(--line); }
""".strip()
