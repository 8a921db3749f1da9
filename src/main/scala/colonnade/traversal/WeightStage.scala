package colonnade.traversal

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.PartConfig
import colonnade.numbers.Normalise

final class WeightStageIO(config: PartConfig) extends Bundle {
  val crossed  = Flipped(Decoupled(new CrossedTriangle(config)))
  val weighted = Decoupled(new WeightedTriangle(config))
}

/** Barycentric weights: the edges' magnitudes, shifted so that their sum fills `weightBits`; numbers.md 4.4.
  *
  * One triangle at a time, every 7 cycles: two cycles for the sum, one to count its leading zeros, three to shift the
  * edges through one shifter, one for the output, in which the next triangle may enter.
  */
final class WeightStage(config: PartConfig) extends Module {
  val io = IO(new WeightStageIO(config))

  private object State extends ChiselEnum { val idle, adding, counting, shifting, offering = Value }
  import State._

  private val formats = new TriangleFormats(config.numbers)

  // Control
  private val state   = RegInit(idle)
  private val edge    = Reg(UInt(2.W))
  private val isFinal = edge === Mux(state === adding, 1.U, 2.U)
  io.weighted.valid := state === offering
  io.crossed.ready  := state === idle || io.weighted.fire
  when(state === adding || state === shifting) { edge := Mux(isFinal, 0.U, edge + 1.U) }
  when(state === adding && isFinal) { state := counting }
  when(state === counting) { state := shifting }
  when(state === shifting && isFinal) { state := offering }
  when(io.weighted.fire) { state := idle }
  when(io.crossed.fire) {
    state := adding
    edge  := 0.U
  }

  // Datapath: a ring of three edges, which weights replace one by one
  private val triangle = Reg(new CrossedTriangle(config))
  private val ring     = triangle.magnitudes
  private val total    = Reg(UInt(formats.edgeBits.W))
  private val zeros    = Reg(UInt(formats.zerosBits.W))
  private val sum      = Reg(UInt(formats.weightBits.W))

  private val weight =
    TriangleFormats.shiftLeft(ring(0), zeros)(formats.edgeBits - 1, formats.edgeBits - formats.weightBits)
  private val sumSoFar = Mux(edge === 1.U, 0.U, sum) + ring(2)(formats.weightBits - 1, 0)

  when(state === shifting) {
    ring(0) := ring(1)
    ring(1) := ring(2)
    ring(2) := weight
  }
  when(state === adding) { total := Mux(edge === 0.U, ring(0), total) + Mux(edge === 0.U, ring(1), ring(2)) }
  when(state === counting) { zeros := Normalise.countLeadingZeros(total)._2 }
  when(state === shifting) { sum := sumSoFar }
  when(io.crossed.fire) { triangle := io.crossed.bits }

  io.weighted.bits.weights  := VecInit(ring.map(_(formats.weightBits - 1, 0)))
  io.weighted.bits.sum      := sumSoFar
  io.weighted.bits.depths   := triangle.depths
  io.weighted.bits.id       := triangle.id
  io.weighted.bits.backSide := triangle.backSide
}
