"""The margin model: the maximum initial mass of any leg of any spacecraft, by physics and a net.

Feasible is m0 <= m*, so the model estimates log m*. Its inputs contain neither
the initial mass nor the thrust: m* is proportional to the thrust and the answer
monotone in the initial mass by construction.
"""
