"""The style sheet of a report's page; it stands in the page, which loads nothing."""

CSS = """
:root { --ink: #1c2430; --muted: #66717f; --line: #e3e7ed; --accent: #0b6e99; --bad: #b3261e;
  --doubt: #8a6100; --soft: #f6f8fa; }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0; color: var(--ink); background: #fff; line-height: 1.5; font-size: 16px;
  font-family: -apple-system, "Segoe UI", Inter, Roboto, "Helvetica Neue", Arial, sans-serif; }
main { max-width: 1020px; margin: 0 auto; padding: 44px 28px 80px; }
h1 { font-size: 31px; line-height: 1.2; letter-spacing: -0.02em; margin: 0; font-weight: 650; }
h2 { font-size: 20px; letter-spacing: -0.01em; margin: 52px 0 4px; font-weight: 620; }
h3 { font-size: 16px; margin: 34px 0 2px; font-weight: 620; }
p { margin: 6px 0; }
.kind { color: var(--accent); font-weight: 600; font-size: 13px; letter-spacing: 0.06em;
  text-transform: uppercase; margin: 0 0 8px; }
.lead, .caption { color: var(--muted); max-width: 78ch; }
.caption { font-size: 14.5px; margin-bottom: 14px; }
.verdict { display: flex; gap: 14px; align-items: baseline; margin: 22px 0 26px;
  border-left: 4px solid var(--accent); background: var(--soft); padding: 12px 18px;
  border-radius: 0 8px 8px 0; }
.verdict b { color: var(--accent); font-size: 18px; text-transform: uppercase;
  letter-spacing: 0.04em; }
.verdict.fail { border-color: var(--bad); } .verdict.fail b { color: var(--bad); }
.verdict.inconclusive { border-color: var(--doubt); }
.verdict.inconclusive b { color: var(--doubt); }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(148px, 1fr)); gap: 1px;
  background: var(--line); border: 1px solid var(--line); border-radius: 10px; overflow: hidden; }
.tiles div { background: #fff; padding: 14px 16px; }
.tiles span { display: block; color: var(--muted); font-size: 13px; }
.tiles b { font-size: 22px; font-weight: 620; letter-spacing: -0.01em;
  font-variant-numeric: tabular-nums; }
table { border-collapse: collapse; width: 100%; margin: 12px 0 4px; font-size: 14.5px; }
th { text-align: left; font-weight: 600; color: var(--muted); font-size: 13px; }
th, td { padding: 8px 14px 8px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.met { color: var(--accent); font-weight: 600; white-space: nowrap; }
td.missed { color: var(--bad); font-weight: 600; white-space: nowrap; }
td.open { color: var(--doubt); font-weight: 600; white-space: nowrap; }
td.code, code { font-family: ui-monospace, "SF Mono", Menlo, Consolas, monospace; font-size: 13px;
  overflow-wrap: anywhere; }
td.key { color: var(--muted); width: 150px; white-space: nowrap; }
figure { margin: 0; } figure svg { width: 100%; height: auto; display: block; }
figure svg text { font-family: inherit !important; }
td small { display: block; color: var(--muted); font-size: 13.5px; max-width: 70ch; }
.checked { color: var(--muted); font-size: 13.5px; margin-top: 10px; }
pre { background: var(--soft); border-radius: 8px; padding: 14px 18px; overflow-x: auto;
  font: 13px/1.5 ui-monospace, "SF Mono", Menlo, Consolas, monospace; }
ul { margin: 8px 0; padding-left: 20px; } li { margin: 3px 0; }
.notes { border-left: 4px solid var(--doubt); background: #fdf8ec; padding: 8px 18px;
  border-radius: 0 8px 8px 0; margin: 16px 0; }
.scroll { overflow-x: auto; }
section.run { border-top: 1px solid var(--line); margin-top: 60px; padding-top: 36px; }
a { color: var(--accent); text-decoration: none; } a:hover { text-decoration: underline; }
@media print { main { max-width: none; padding: 0; }
  figure, table, .tiles { break-inside: avoid; } }
"""
