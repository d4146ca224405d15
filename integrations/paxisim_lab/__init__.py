"""The laboratory around `paxisim_insertion`: matrices of trainings, their tables, curves, reports, films and costs."""
