/** How sensor, workers, hub and disk are. */
import { html } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import { type Overview, type Sensor, ask } from "./api.ts";
import { type Desk, type Level, Rows, action, bytes, mark, section } from "./parts.ts";

const LEVELS: Readonly<Record<string, Level>> = {
  streaming: "good", serving: "good", warming: "waits", opening: "waits", rebuilding: "waits",
};

interface Tile {
  readonly name: string;
  readonly title: string;
  readonly level: Level;
  readonly state: string;
  readonly more: readonly string[];
  /** Of the sensor that can be restarted. */
  readonly sensor?: string;
}

/** The first section. */
export class Health {
  readonly element: HTMLElement;
  private readonly desk: Desk;
  private readonly tiles: Rows<Tile>;

  constructor(desk: Desk) {
    this.desk = desk;
    const list = html("ul", { class: "tiles" });
    this.element = section("health", desk.texts.t("operator.health"), list);
    this.tiles = new Rows(list, (tile) => this.tile(tile));
  }

  /** Shows how it is now. */
  show(now: Overview): void {
    this.tiles.show(tilesOf(this.desk.texts, now), (tile) => tile.name);
  }

  private tile(tile: Tile): HTMLElement {
    const { t } = this.desk.texts;
    const { sensor } = tile;
    return html("li", { class: `tile ${tile.level}`, "data-tile": tile.name },
      html("h3", {}, tile.title), mark(tile.level, tile.state),
      ...tile.more.filter(Boolean).map((line) => html("p", {}, line)),
      ...(sensor === undefined ? [] : [action("restart", t("operator.sensor.restart"), () => {
        void this.restart(sensor);
      }, "plain", sensor)]));
  }

  private async restart(sensor: string): Promise<void> {
    const { t } = this.desk.texts;
    if (await this.desk.confirm({
      title: t("operator.sensor.restart.title"), text: t("operator.sensor.restart.text"),
      yes: t("operator.sensor.restart") })) {
      await this.desk.act(() => ask("sensor/restart", "POST", { sensor }),
        t("operator.sensor.restarted"));
    }
  }
}

function tilesOf(texts: Texts, { status, kiosk }: Overview): Tile[] {
  const { t } = texts;
  const hub = t("operator.hub");
  if (!status) {
    return [{ name: "hub", title: hub, level: "bad", state: t("operator.hub.gone"), more: [] }];
  }
  const sensors = status.sensor_states.map((sensor) => sensorTile(texts, sensor));
  const free = status.free_bytes;
  return [
    ...(sensors.length ? sensors : [{
      name: "sensor", title: t("operator.sensor"), level: "bad" as const,
      state: t("operator.sensor.none"), more: [] }]),
    {
      name: "worker", title: t("operator.worker"), level: status.workers.length ? "good" : "bad",
      state: status.workers.length ? t("operator.worker.count", { count: status.workers.length })
        : t("operator.worker.none"),
      more: [t("operator.worker.jobs", { queued: status.queued, working: status.working })],
    },
    {
      name: "hub", title: hub, level: LEVELS[status.state] ?? "bad",
      state: texts.t(`operator.hub.${status.state}`,
        { read: status.files_read, all: status.files_to_read }),
      more: [status.hub_version],
    },
    ...(free === null ? [] : [{
      name: "disk", title: t("operator.disk"),
      level: (free > 4 * kiosk.reserve_bytes ? "good"
        : free > kiosk.reserve_bytes ? "waits" : "bad") as Level,
      state: t("operator.disk.free", { free: bytes(texts, free) }),
      more: [status.kept_bytes === null ? ""
        : t("operator.disk.kept", { kept: bytes(texts, status.kept_bytes) })],
    }]),
  ];
}

function sensorTile(texts: Texts, sensor: Sensor): Tile {
  return {
    name: `sensor ${sensor.name}`, title: texts.t("operator.sensor"),
    level: LEVELS[sensor.state] ?? "bad",
    state: texts.either(`operator.sensor.${sensor.state}`, "operator.sensor.other"),
    more: [sensor.identity || sensor.name, sensor.reason,
      texts.t("operator.sensor.figures", { ...sensor.figures })],
    sensor: sensor.name,
  };
}
