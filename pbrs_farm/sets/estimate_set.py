"""Estimated cost of a set: hours, bytes, and dollars on clouds by a table of prices. No effects.

prices.csv has a row a price, with source and date. A cloud is its rows; another one needs no code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.record import Record, read_csv
from pbrs_farm.core.table import Table
from pbrs_farm.run.costs import RunCost, cost_of_run, measured, megapixels
from pbrs_farm.sets.data_set import DataSet

PriceName = Literal[
    "cpu_hour", "cpu_hour_spot", "gpu_hour", "gpu_hour_spot", "gb_month", "put_1000"
]
_HOUR_S: Final = 3600.0


class Price(Record):
    """A price of a cloud: dollars a unit of `what`."""

    cloud: str
    what: PriceName
    usd: Annotated[float, Field(gt=0)]
    of: str  # machine, region
    source: str
    date: date


@cache
def prices() -> Mapping[str, Mapping[PriceName, Price]]:
    """Cloud -> what -> its price, in the table's order.

    >>> {"cpu_hour", "gb_month"} <= set(prices()["AWS"])
    True
    """
    by_cloud: dict[str, dict[PriceName, Price]] = {}
    for row in read_csv(Path(__file__).with_name("prices.csv"), Price):
        by_cloud.setdefault(row.cloud, {})[row.what] = row
    return by_cloud


class CloudCost(Record):
    """Cost of a set on a cloud, in US dollars; None for an unknown price.

    on_demand, spot: of the CPU alone. gpu, gpu_spot: light on an H100, the rest on the CPU.
    """

    cloud: str
    on_demand: float | None
    spot: float | None
    gpu: float | None
    gpu_spot: float | None
    storage_a_month: float | None
    writing: float | None
    read_on: str  # the oldest date of its prices


class BillLine(Record):
    """A line of a bill: an amount at a price, in US dollars; None for an unknown price."""

    what: str
    amount: float
    usd_each: float | None
    usd: float | None
    of: str  # machine, region
    read_on: str  # "" for an unknown price


class SetEstimate(Record):
    """Cost of making a set: all parts and forms together, then by part, then in dollars."""

    name: str
    houses: int
    views: int
    cpu_hours: float
    gpu_hours: float  # of light, if it is traced on an H100
    cpu_hours_beside_gpu: float
    gigabytes: float  # 10^9 bytes
    gigabytes_with_radiance: float
    gigabytes_without_radiance: float
    radiance_kept: tuple[str, ...]  # parts without `drop_radiance`
    files: int  # of the parts
    parts: Mapping[str, Mapping[str, int | float]]
    clouds: tuple[CloudCost, ...]

    def bill(self, cloud: str) -> tuple[BillLine, ...]:
        """The bill of a cloud, with a line for each way to compute the light.

        GPU hours are of light on one H100, as measured on one scene.
        """
        amounts: tuple[tuple[str, float, PriceName, int], ...] = (
            ("CPU hours", self.cpu_hours, "cpu_hour", 1),
            ("CPU hours, spot", self.cpu_hours, "cpu_hour_spot", 1),
            ("GPU hours of light instead", self.gpu_hours, "gpu_hour", 1),
            ("GPU hours of light, spot", self.gpu_hours, "gpu_hour_spot", 1),
            ("CPU hours beside the GPU", self.cpu_hours_beside_gpu, "cpu_hour", 1),
            ("GB stored for a month", self.gigabytes, "gb_month", 1),
            ("objects written", self.files, "put_1000", 1000),
        )
        of = prices()[cloud]
        return tuple(
            _bill_line(item, amount, of.get(name), per) for item, amount, name, per in amounts
        )


def estimate_set(data_set: DataSet) -> SetEstimate:
    """The cost of a set, by run/costs.csv and prices.csv.

    Views that rules leave out are counted. The CPU time of forms is neglected: at most seconds a view.
    """
    costs = {p.name: cost_of_run(p.recipe, p.want, p.n_houses) for p in data_set.parts}
    whole = sum(costs.values(), RunCost())
    n_bytes = whole.n_bytes + _form_bytes(data_set, costs)
    dropped = sum(
        costs[part.name].n_radiance_bytes for part in data_set.parts if part.want.drop_radiance
    )
    parts = {
        name: {
            "houses": cost.n_houses,
            "views": cost.n_views,
            "cpu_hours": round(cost.cpu_s / _HOUR_S, 2),
            "gigabytes": round(cost.n_bytes / 1e9, 2),
        }
        for name, cost in costs.items()
    }
    return SetEstimate(
        name=data_set.name,
        houses=whole.n_houses,
        views=whole.n_views,
        cpu_hours=round(whole.cpu_s / _HOUR_S, 2),
        gpu_hours=round(whole.gpu_s / _HOUR_S, 2),
        cpu_hours_beside_gpu=round(whole.cpu_beside_gpu_s / _HOUR_S, 2),
        gigabytes=round(n_bytes / 1e9, 2),
        gigabytes_with_radiance=round((n_bytes + dropped) / 1e9, 2),
        gigabytes_without_radiance=round((n_bytes + dropped - whole.n_radiance_bytes) / 1e9, 2),
        radiance_kept=tuple(
            part.name
            for part in data_set.parts
            if not part.want.drop_radiance and costs[part.name].n_radiance_bytes
        ),
        files=round(whole.n_files),
        parts=parts,
        clouds=tuple(_on_cloud(name, of, whole, n_bytes) for name, of in prices().items()),
    )


def _form_bytes(data_set: DataSet, costs: Mapping[str, RunCost]) -> float:
    pixels = {part.name: megapixels(part.recipe) * 1e6 for part in data_set.parts}
    total = 0.0
    for form in data_set.forms:
        size = form.choice.size or (form.packing.size if form.packing else None)
        for part in form.parts:
            n_pixels = size[0] * size[1] if size else pixels[part]
            total += costs[part].n_views * n_pixels * measured()["form_bytes"]
    return total


def _on_cloud(
    name: str, of: Mapping[PriceName, Price], whole: RunCost, n_bytes: float
) -> CloudCost:
    def usd(*amounts: tuple[PriceName, float]) -> float | None:
        if any(name not in of for name, _amount in amounts):
            return None
        return round(sum(of[name].usd * amount for name, amount in amounts), 2)

    cpu, gpu, beside = (s / _HOUR_S for s in (whole.cpu_s, whole.gpu_s, whole.cpu_beside_gpu_s))
    return CloudCost(
        cloud=name,
        on_demand=usd(("cpu_hour", cpu)),
        spot=usd(("cpu_hour_spot", cpu)),
        gpu=usd(("gpu_hour", gpu), ("cpu_hour", beside)),
        gpu_spot=usd(("gpu_hour_spot", gpu), ("cpu_hour_spot", beside)),
        storage_a_month=usd(("gb_month", n_bytes / 1e9)),
        writing=usd(("put_1000", whole.n_files / 1000)),
        read_on=min(price.date for price in of.values()).isoformat(),
    )


def _bill_line(what: str, amount: float, price: Price | None, per: int) -> BillLine:
    if price is None:
        return BillLine(what=what, amount=amount, usd_each=None, usd=None, of="", read_on="")
    return BillLine(
        what=what,
        amount=amount,
        usd_each=price.usd / per,
        usd=round(amount * price.usd / per, 2),
        of=price.of,
        read_on=price.date.isoformat(),
    )


def clouds_of(names: Sequence[str]) -> list[str]:
    """The clouds of the table by name, in any case; BadInput for an unknown one."""
    clouds = {cloud.casefold(): cloud for cloud in prices()}
    for name in names:
        if name.casefold() not in clouds:
            hint = f"of {', '.join(clouds.values())}: prices.csv has a row a price"
            raise BadInput("--cloud", name, "no prices of this cloud", hint=hint)
    return [clouds[name.casefold()] for name in names]


def bill_text(bill: Sequence[BillLine]) -> str:
    """A bill as a text table; "-" for an unknown price."""
    columns = ("what", "amount", "US dollars each", "US dollars", "of", "read on")
    rows = [
        (
            b.what,
            b.amount,
            "-" if b.usd_each is None else f"{b.usd_each:.6g}",
            "-" if b.usd is None else b.usd,
            b.of,
            b.read_on,
        )
        for b in bill
    ]
    return _text_of(columns, rows)


def estimate_text(estimate: SetEstimate) -> str:
    """An estimate as text tables: a line a part, the sum, a line a cloud; "-" for an unknown price."""
    e = estimate
    sizes = ("part", "houses", "views", "CPU hours", "GB")
    rows = [(name, *p.values()) for name, p in e.parts.items()]
    rows += [("all, with forms", e.houses, e.views, e.cpu_hours, e.gigabytes)]
    costs = (
        "US dollars",
        "on demand",
        "spot",
        "with H100",
        "with H100, spot",
        "a month stored",
        "written",
        "read on",
    )
    on_clouds = [
        (c.cloud, c.on_demand, c.spot, c.gpu, c.gpu_spot, c.storage_a_month, c.writing, c.read_on)
        for c in e.clouds
    ]
    light = f"With light on an H100: {e.gpu_hours:,} GPU hours and {e.cpu_hours_beside_gpu:,} CPU hours."
    size = f"radiance.exr: {e.gigabytes_with_radiance:,} GB with it, {e.gigabytes_without_radiance:,} without. Parts that keep it: {', '.join(e.radiance_kept) or 'none'} (drop_radiance)."
    return "\n".join([_text_of(sizes, rows), size, light, "", _text_of(costs, on_clouds)])


def _text_of(columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    shown = [
        [
            f"{v:,.2f}" if isinstance(v, float) else f"{v:,}" if isinstance(v, int) else v
            for v in row
        ]
        for row in rows
    ]
    return repr(Table(columns, [dict(zip(columns, row, strict=True)) for row in shown]))
