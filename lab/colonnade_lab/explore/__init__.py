"""The design-space explorer: measures quality, speed, area and power of many configurations.

A study file names configurations, workloads and measures (`study`, `points`). Each measurement is a job with a key made
of its inputs (`jobs`, `frames`, `work`). The jobs run on this machine or on a Dask cluster (`runners`), and their
results become one table, with a Pareto front and the paper's RenderIndex (`results`, `render_index`).

The benchmark (`bench`) runs the same jobs.
"""
