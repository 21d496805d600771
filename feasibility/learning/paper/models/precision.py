"""In which number format a network is trained.

In bfloat16 (torch's automatic mixed precision) the matrix products are rounded
to 8 binary digits, while weights, their updates, the sums inside a product and
the loss stay in float32. Processors with AMX tiles and GPUs multiply such
matrices many times faster. Prediction is always float32 (`classifier.paper.predictors`).
"""

from typing import Any, Final

PRECISIONS: Final = ("auto", "float32", "bfloat16")
"""What can be asked for; "auto" is bfloat16 where the hardware multiplies it natively."""


def resolve_precision(torch: Any, precision: str, device: str) -> str:
    """Return "float32" or "bfloat16".

    Parameters
    ----------
    torch : module
        The library.
    precision : str
        One of `PRECISIONS`. "bfloat16" is taken at its word: without the
        hardware it is emulated, and slow.
    device : str
        "cpu" or "cuda".
    """
    if precision != "auto":
        return precision
    native = _gpu_has_bfloat16(torch) if device == "cuda" else _processor_has_tiles(torch)
    return "bfloat16" if native else "float32"


def _gpu_has_bfloat16(torch: Any) -> bool:
    # Ampere (compute capability 8) and later; earlier ones emulate it.
    return bool(torch.cuda.get_device_capability()[0] >= 8)


def _processor_has_tiles(torch: Any) -> bool:
    """Return whether the processor multiplies bfloat16 matrices in AMX tiles.

    What torch calls the question differs between its versions; one that has no
    answer counts as no.
    """
    capabilities: dict[str, Any] = getattr(torch.cpu, "get_capabilities", dict)()
    if "amx_bf16" in capabilities:
        return bool(capabilities["amx_bf16"])
    return bool(getattr(torch.cpu, "_is_amx_tile_supported", bool)())
