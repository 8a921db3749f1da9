package colonnade.query

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, RegEnable}
import colonnade.formats.RaySensor
import colonnade.numbers.{Float32, Normalise}

/** A ray of a sensor: its block and number in it, and its direction. */
final class SensorRay extends Bundle {
  val block = UInt(log2Ceil(Run.blocks).W)
  val index = UInt(log2Ceil(Run.rays).W)
  val dir   = Vec(3, new Float32)
}

final class SensorReaderIO extends Bundle {
  val right = Input(RaySensor.vector)             // constant while rays are in the unit
  val runs  = Flipped(Decoupled(new Run))
  val block = Input(UInt(log2Ceil(Run.blocks).W)) // of the run
  val rays  = Decoupled(new SensorRay)
}

/** Makes the rays of runs of a sensor, by an addition each: a ray a cycle, and a cycle between runs. */
final class SensorReader extends Module {
  val io = IO(new SensorReaderIO)

  // A sum a cycle
  private val left   = RegInit(0.U(log2Ceil(Run.rays + 1).W))
  private val block  = RegEnable(io.block, io.runs.fire)
  private val index  = Reg(UInt(log2Ceil(Run.rays).W))
  private val sums   = Reg(RaySensor.vector)
  private val makes  = left =/= 0.U
  private val valids = Seq.fill(3)(RegInit(false.B))
  private val moves  = !valids.last || io.rays.ready
  io.runs.ready := !makes
  when(makes && moves) {
    left  := left - 1.U
    index := index + 1.U
    sums.zip(io.right).foreach { case (sum, step) => sum := sum + step }
  }
  when(io.runs.fire) {
    left  := io.runs.bits.count
    index := 0.U
    sums  := io.runs.bits.dir
  }
  when(moves) { valids.zip(makes +: valids).foreach { case (to, from) => to := from } }

  // Its magnitude, its leading digits, and the nearest float
  io.rays.valid      := valids.last
  io.rays.bits.block := Seq.iterate(block, 4)(load).last
  io.rays.bits.index := Seq.iterate(index, 4)(load).last
  for ((sum, float) <- sums.zip(io.rays.bits.dir)) {
    val width    = sum.getWidth
    val digits   = load(Normalise(load(Normalise.magnitude(sum.asSInt)), width))
    val rest     = digits.mantissa(width - Float32.mantissaBits - 1, 0)
    val whole    = digits.mantissa >> (width - Float32.mantissaBits)
    val roundsUp = rest.head(1).asBool && (rest.tail(1).orR || whole(0))
    val rounded  = whole +& roundsUp
    val exponent = digits.exponent +& (Float32.half - RaySensor.fractionBits).U + rounded.head(1)
    val nearest  = Wire(new Float32)
    nearest.isNegative := Seq.iterate(sum(width - 1), 3)(load).last
    nearest.biased     := exponent
    nearest.fraction   := rounded(Float32.mantissaBits - 2, 0)
    when(digits.exponent === 0.U) { nearest := Float32.zero }
    float := load(nearest)
  }

  private def load[T <: Data](value: T): T = RegEnable(value, moves)
}
