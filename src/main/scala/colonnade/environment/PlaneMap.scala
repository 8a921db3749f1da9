package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{BoundingPlaneEntry, Load}

final class PlaneMapIO(config: ColonnadeConfig, tagBits: Int) extends Bundle {
  private val layout = AttributeLayout.of(config)

  val load   = Flipped(Valid(new Load(config)))
  val cells  = Flipped(new AttributeChannel(new CellRequest(layout), new CellResponse(layout), tagBits))
  val planes = Flipped(new AttributeChannel(new PlaneRequest(layout), new BoundingPlaneEntry, tagBits))
}

/** The environment's planes. One channel gives the planes of a tile or cell, the other one a plane's coefficients; neither
  * waits for the other.
  */
final class PlaneMap(config: ColonnadeConfig, tagBits: Int) extends Module {
  val io = IO(new PlaneMapIO(config, tagBits))

  private val cells = Module(new CellLookup(config, tagBits))
  private val table = Module(new PlaneTable(config, tagBits))
  cells.io.load := io.load
  table.io.load := io.load
  io.cells <> cells.io.cells
  io.planes <> table.io.planes
}
