package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{AttributeEvents, Load}

final class ColumnEnvironmentIO(config: ColonnadeConfig) extends Bundle {
  val load = Flipped(Valid(new Load(config))) // only while no request is in flight

  /** One for each march, and one for the pipeline of directly seen pixels. */
  val ports = Vec(config.mapRequesters, Flipped(new AttributePort(AttributeLayout.of(config))))

  /** To the maps that some columns share, if the configuration says so. */
  val shared = Option.when(config.columnsPerCopy > 1)(AttributePort.ofColumn(config))
  val events = Output(new AttributeEvents)
}

/** A column's access to the environment's maps: its own copy, or a port to one that some columns share. */
final class ColumnEnvironment(config: ColonnadeConfig) extends Module {
  val io = IO(new ColumnEnvironmentIO(config))

  io.shared match {
    case Some(shared) =>
      val units = Module(new AttributeConcentrator(config, config.mapRequesters, tagBits = 0, ofColumn = true))
      units.io.ports <> io.ports
      shared <> units.io.joined
      io.events := shared.events
    case None =>
      val maps = Module(new PhysicalAttributeMemory(config, config.mapRequesters, tagBits = 0, ofColumn = true))
      maps.io.ports <> io.ports
      maps.io.load := io.load
      io.events    := maps.io.events
  }
}
