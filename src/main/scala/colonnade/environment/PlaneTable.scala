package colonnade.environment

import chisel3._
import chisel3.util.{RegEnable, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{BoundingPlaneEntry, Load, Plane}

final class PlaneTableIO(config: ColonnadeConfig, tagBits: Int) extends Bundle {
  val load   = Flipped(Valid(new Load(config)))
  val planes =
    Flipped(new AttributeChannel(new PlaneRequest(AttributeLayout.of(config)), new BoundingPlaneEntry, tagBits))
}

/** The coefficients of the map's planes and of the bounding planes. Latency one cycle, one plane a cycle. */
final class PlaneTable(config: ColonnadeConfig, tagBits: Int) extends Module {
  val io = IO(new PlaneTableIO(config, tagBits))

  private val table    = AttributeStore(config, "planes.planes", io.load)
  private val bounding = AttributeStore(config, "planes.bounding", io.load)
  private val req      = io.planes.req

  req.ready           := true.B
  table.read.valid    := req.valid && !req.bits.content.isBoundingPlane
  table.read.bits     := req.bits.content.index
  bounding.read.valid := req.valid && req.bits.content.isBoundingPlane
  bounding.read.bits  := req.bits.content.index

  private val isBoundingPlane = RegEnable(req.bits.content.isBoundingPlane, req.valid)
  private val entry           = bounding.word.asTypeOf(new BoundingPlaneEntry)
  io.planes.resp.valid              := RegNext(req.valid, false.B)
  io.planes.resp.bits.tag           := RegEnable(req.bits.tag, req.valid)
  io.planes.resp.bits.isIllegal     := false.B
  io.planes.resp.bits.content       := entry
  io.planes.resp.bits.content.plane := Mux(isBoundingPlane, entry.plane, table.word.asTypeOf(new Plane))
}
