"""The scalability study: a scene goes in; simulated runs, tables, figures, traces and one report come out.

`plan` says which runs a study needs, `sweep` has them made and `store` keeps them; `data` derives speedups,
losses and limits; `tables`, `figures`, `traces` and `page` write; `words` and `claims` say what they show.
The runs themselves are the extension's, see `engine`. Only `figures` needs matplotlib.
"""
