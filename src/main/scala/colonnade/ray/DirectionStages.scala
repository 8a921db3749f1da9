package colonnade.ray

import chisel3._
import chisel3.util.{Cat, Mux1H, RegEnable}
import colonnade.config.PathConfig
import colonnade.numbers.{Normalise, Rounding}

final class DirectionStagesIO(config: PathConfig) extends Bundle {
  val loads   = Input(Vec(2, Bool()))
  val request = Input(new RayRequest(config))

  /** The ray in stage 0, in its own frame; its mantissas in stage 1. */
  val ray       = Output(new PermutedRay(config))
  val mantissas = Output(new DirectionMantissas(config.numbers))
}

/** What a [[DirectionNormaliser]] does, a ray a cycle: stage 0 has the magnitudes; from there, three normalisers and three
  * comparators in parallel lead to stage 1. Source: docs/numbers.md, sections 2.1 and 2.2.
  */
final class DirectionStages(config: PathConfig) extends Module {
  private val numbers = config.numbers

  val io = IO(new DirectionStagesIO(config))

  private val request    = io.request
  private val context    = RegEnable(request.context, io.loads(0))
  private val isShadow   = RegEnable(request.isShadow, io.loads(0))
  private val origin     = request.origin.axes.map(RegEnable(_, io.loads(0)))
  private val magnitudes = request.dir.axes.map(component => RegEnable(Normalise.magnitude(component), io.loads(0)))
  private val negative   = request.dir.axes.map(component => RegEnable(component < 0.S, io.loads(0)))

  // Ties go to the lowest axis
  private val isZ = magnitudes(2) > magnitudes(1) && magnitudes(2) > magnitudes(0)
  private val isY = magnitudes(1) > magnitudes(0) && !isZ

  /** Components in the ray's own frame. */
  private def permuted[T <: Data](axes: Seq[T]): Seq[T] = Seq(1, 2, 0).map { shift =>
    def after(axis: Int) = axes((axis + shift) % 3)
    Mux1H(Seq((!isY && !isZ) -> after(0), isY -> after(1), isZ -> after(2)))
  }

  private val normalised                   = permuted(magnitudes.map(Normalise(_, numbers.mantissaBits)))
  private val Seq(minor0, minor1, largest) = normalised
  private val info                         = io.ray.info
  info.context          := context
  info.isShadow         := isShadow
  info.orientation.axis := Cat(isZ, isY)
  info.orientation.negative.zip(permuted(negative)).foreach { case (to, from) => to := from }
  info.exponent.zip(normalised).foreach { case (to, from) => to := largest.exponent - from.exponent }
  info.isZero.zip(normalised).foreach { case (to, from) => to := from.exponent === 0.U }
  io.ray.origin.zip(permuted(origin)).foreach { case (to, from) => to := from }

  private val length    = Rounding.saturate(permuted(magnitudes).last, numbers.sceneBits + 1)
  private val unlimited = ((BigInt(1) << (numbers.sceneBits + 1)) - 1).U
  io.ray.tMax := Mux(isShadow, length, unlimited)
  for (limits <- io.ray.limits; requested <- request.limits) {
    limits      := RegEnable(requested, io.loads(0))
    io.ray.tMax := limits.tMax
  }

  for (visit <- request.visit) {
    val held = RegEnable(visit, io.loads(0))
    info.ofVisit(held)
    when(held.valid) { io.ray.tMax := held.bits.tMax }
  }

  io.mantissas.minor.zip(Seq(minor0, minor1)).foreach { case (to, from) =>
    to := RegEnable(from.mantissa, io.loads(1))
  }
  io.mantissas.dominant := RegEnable(largest.mantissa, io.loads(1))
}
