package colonnade.unit

import chisel3._
import chisel3.experimental.hierarchy.{instantiable, public}
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.environment.{AttributePort, MarchPort}
import colonnade.formats.{FrameRegisters, Pixel, RecordBroadcast, RecordRequest, UnitEvents, UnitPosition}
import colonnade.shading.TexturePort

/** Ports of a render unit. `registers` is constant while a frame runs; `start` precedes the first position. */
final class RenderUnitIO(config: ColonnadeConfig) extends Bundle {
  val row        = Input(UInt(log2Ceil(config.recordRequesters.max(2)).W))
  val registers  = Input(new FrameRegisters(config))
  val start      = Input(Bool())
  val positions  = Flipped(Decoupled(new UnitPosition(config)))
  val requests   = Decoupled(new RecordRequest(config))
  val broadcasts = Flipped(Vec(config.columnBvhMemory.banks, Valid(new RecordBroadcast(config))))
  val pixels     = Decoupled(new Pixel(config))

  /** To the maps of the environment, for a march of its own; or to the marches of the column. */
  val maps = Option.when(config.hasEnvironment && !config.sharesMarches)(
    new AttributePort(AttributeLayout.of(config), AttributePort.tagBits(config))
  )
  val marches = Option.when(config.sharesMarches)(new MarchPort(config))

  /** To the textures. */
  val texture = config.geometry.texture.map(_ => new TexturePort(config))

  /** No pixel is in flight. */
  val isIdle = Output(Bool())
  val events = Output(new UnitEvents(config))
}

/** A module with the ports of a render unit: [[RenderUnit]], or what specs put in its place. */
@instantiable
abstract class RenderUnitModule(config: ColonnadeConfig) extends Module {
  @public val io: RenderUnitIO = IO(new RenderUnitIO(config))
}
