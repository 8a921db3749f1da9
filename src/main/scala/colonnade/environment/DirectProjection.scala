package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.EnvironmentView
import colonnade.numbers.{Normalise, Rounding}

/** Where a directly seen pixel lies in the map. */
final class DirectPlace(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)

  val u, v  = SInt(formats.originBits.W)                      // from the map's centre, in map units
  val pixel = new MapPixel(AttributeLayout.of(config.device)) // the map's pixel
}

/** How fast a pixel's ray goes away from the camera: mantissa · 2^(exponent - f). */
final class DirectRate(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)

  val mantissa   = UInt(formats.f.W)
  val exponent   = UInt(formats.exponentBits.W)
  val isReceding = Bool()
}

final class DirectProjectionIO(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)

  val view = Input(new EnvironmentView(config.numbers))

  /** A ray, only in a cycle after one with `isReady`. */
  val ray     = Flipped(Valid(new EnvironmentRay(config)))
  val isReady = Output(Bool())

  val hasSpace = Input(Bool()) // the cycle after this one takes a place

  /** In the fourth cycle after the ray, or later, with the ray's direction. */
  val place = Valid(new DirectPlace(config))
  val dir   = Output(Vec(3, SInt((formats.f + 1).W)))

  val rate = Valid(new DirectRate(config)) // six cycles after the place
}

/** Finds the map's pixel of a ray from the camera, and the growth of the ray's depth: a ray every four cycles.
  *
  * One multiplier for the two coordinates of the pixel, one for the three products of the depth.
  */
final class DirectProjection(config: PathConfig) extends Module {
  private val formats = new MarchFormats(config.device)
  import DirectView.latch
  import formats._

  val io = IO(new DirectProjectionIO(config))

  // Four cycles of a ray
  private val isHeld = RegInit(false.B)
  private val at     = Reg(UInt(2.W))
  private val ray    = latch(io.ray.bits, io.ray.valid)
  private val leaves = isHeld && at === 3.U && io.hasSpace
  when(io.ray.valid) {
    isHeld := true.B
    at     := 0.U
  }.elsewhen(leaves) { isHeld := false.B }.elsewhen(at =/= 3.U) { at := at + 1.U }
  // One cycle before the ray leaves, its space is certain: only this unit takes it
  io.isReady := !isHeld || (at(1) && io.hasSpace)

  io.dir := VecInit(ray.dir.axes)

  // The pixel: (2 · pixel + 1) · step
  private val halfPixels  = Mux(at(0), ray.pixel.y, ray.pixel.x) ## 1.U(1.W)
  private val position    = latch(halfPixels * Mux(at(0), io.view.stepY, io.view.stepX))
  private val coordinates = for (axis <- 0 until 2) yield {
    val coordinate = Rounding.floor(position, EnvironmentView.stepGuard)
    val inMap      = Rounding.floor(coordinate, pixelFraction)
    val pixel = Mux(inMap >= sizes(axis).U, (sizes(axis) - 1).U, inMap)(Seq(layout.xBits, layout.yBits)(axis) - 1, 0)
    val fromCentre = (coordinate.zext - centre(axis).S).asUInt.pad(originBits)(originBits - 1, 0).asSInt
    val isNow      = at === (axis + 1).U
    (latch(fromCentre, isNow), latch(pixel, isNow))
  }
  io.place.valid        := leaves
  io.place.bits.u       := coordinates.head._1
  io.place.bits.v       := coordinates.last._1
  io.place.bits.pixel.x := coordinates.head._2
  io.place.bits.pixel.y := coordinates.last._2

  // The growth of the depth: the matrix's last row times the direction. Both shift, so that the factors are registers
  private val atRate  = RegInit(4.U(3.W))
  private val row     = io.view.matrix(2).axes
  private val rateDir = Reg(chiselTypeOf(io.dir))
  private val factor  = Reg(chiselTypeOf(row.head))
  private val product = latch(rateDir.head * factor)
  when(leaves) {
    rateDir := io.dir
    factor  := row.head
  }.elsewhen(atRate < 4.U) {
    rateDir := VecInit(rateDir.tail :+ rateDir.last)
    factor  := Mux(atRate(0), row(2), row(1))
  }
  private val sum = Reg(SInt((product.getWidth + 2).W))
  when(leaves) { atRate := 0.U }.elsewhen(atRate < 4.U) { atRate := atRate + 1.U }
  when(atRate === 1.U) { sum := product }.elsewhen(atRate === 2.U || atRate === 3.U) { sum := sum + product }

  // The sum stays for two cycles, whatever comes next
  private val sumBits       = sum.getWidth - 1
  private val isSummed      = RegNext(atRate === 3.U, false.B)
  private val magnitude     = sum.asUInt(sumBits - 1, 0)
  private val (zero, zeros) = Normalise.countLeadingZeros(magnitude)
  private val normaliseBy   = latch(zeros, isSummed)
  private val isReceding    = latch(!zero && sum > 0.S, isSummed)
  private val normalised    = (magnitude << normaliseBy)(sumBits - 1, 0)
  io.rate.valid           := RegNext(isSummed, false.B)
  io.rate.bits.mantissa   := normalised(sumBits - 1, sumBits - f)
  io.rate.bits.exponent   := sumBits.U - normaliseBy
  io.rate.bits.isReceding := isReceding
}
