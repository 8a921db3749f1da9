package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.{AlbedoEntry, NormalEntry, Vec3}
import colonnade.numbers.{Divider, Fixed}
import colonnade.ray.RayFormats

/** A point for [[DirectPoint]]; its parts are offered until they are taken. Albedo and normal of hits only. */
final class PointSource(config: PathConfig) extends Bundle {
  val origin   = Output(Vec3(new Fixed(new RayFormats(config.numbers).scene))) // of `pixel`, grid steps
  val pixel    = Decoupled(new DirectPixel(config))
  val distance = Decoupled(new DirectDistance(config))
  val albedo   = Decoupled(new AlbedoEntry)
  val normal   = Decoupled(new NormalEntry)
}

final class MarchHitsIO(config: PathConfig) extends Bundle {
  private val layout = AttributeLayout.of(config.device)

  val hit   = Flipped(Decoupled(new OrderedHit(config)))
  val texel = Flipped(Valid(new BoundingTexel)) // of the last hit, if that is of a bounding plane

  /** At most one request in flight in each channel. */
  val albedo  = new AttributeChannel(new MapPixel(layout), new AlbedoEntry, tagBits = 0)
  val normals = new AttributeChannel(new MapPixel(layout), new NormalEntry, tagBits = 0)

  val point   = new PointSource(config) // not before all parts are there
  val illegal = Output(Bool())          // a response of the maps is illegal
}

/** Completes the hits of a column's marches, one after the other: divides for the distance while albedo and normal are
  * fetched, and adds the way from the camera to the maps. 14 cycles a hit, with 32-bit formats and if the maps respond
  * at once.
  *
  * It waits for responses of the maps alone, and [[DirectPoint]] for nothing but its result to be taken.
  */
final class MarchHits(config: PathConfig) extends Module {
  private val formats = new MarchFormats(config.device)
  import DirectView.latch
  import formats._

  val io = IO(new MarchHitsIO(config))

  private val isHeld  = RegInit(false.B)
  private val item    = latch(io.hit.bits, io.hit.fire)
  private val hit     = item.hit
  private val request = item.order.request
  private val isHit   = hit.kind =/= HitKind.miss
  private val moves   = WireInit(false.B) // to the registers of the point
  io.hit.ready := !isHeld
  when(io.hit.fire) { isHeld := true.B }.elsewhen(moves) { isHeld := false.B }

  // Albedo and normal, of the maps or of a bounding plane
  private val fetches = Seq((io.albedo, io.texel.bits.albedo), (io.normals, io.texel.bits.normal)).map {
    case (channel, ofPlane) =>
      val asks = RegInit(false.B)
      val has  = RegInit(false.B)
      channel.req.valid        := asks
      channel.req.bits.tag     := 0.U
      channel.req.bits.content := hit.pixel
      when(io.hit.fire) { asks := io.hit.bits.hit.kind === HitKind.map }.elsewhen(channel.req.ready) { asks := false.B }
      when(io.hit.fire) { has := false.B }.elsewhen(channel.resp.valid || io.texel.valid) { has := true.B }
      val value = latch(
        Mux(channel.resp.valid, channel.resp.bits.content.asUInt, ofPlane.asUInt),
        channel.resp.valid || io.texel.valid
      )
      (has, value)
  }
  private val Seq((hasAlbedo, albedo), (hasNormal, normal)) = fetches
  io.illegal := Seq(io.albedo.resp, io.normals.resp).map(resp => resp.valid && resp.bits.isIllegal).reduce(_ || _)

  // The distance; for a camera's ray the way to the maps is added, in units of twice the larger one
  private val divider = Module(new Divider(f, f)).io
  divider.division.valid            := io.hit.fire
  divider.division.bits.numerator   := io.hit.bits.hit.numerator
  divider.division.bits.denominator := io.hit.bits.hit.denominator
  divider.quotient.ready            := moves
  private val later    = latch(hit.way.exponent -& hit.exponent)
  private val isLater  = later > 0.S
  private val distance = latch(down(divider.quotient.bits, Mux(isLater, later, 0.S)))
  private val way      = latch(down(hit.way.mantissa, Mux(isLater, 0.S, 0.S -& later)))
  private val sum      = latch((distance +& way)(f, 0))
  private val isSummed = (1 to 2).foldLeft(divider.quotient.valid)((is, _) => RegNext(is && isHeld, false.B))

  // The point, in registers of its own until it is taken
  private val toMaps    = request.isDirectView && isHit
  private val isPending = RegInit(VecInit.fill(4)(false.B)) // distance, pixel, normal and albedo are to be taken
  private val isReady   = isHeld && isSummed && (!isHit || (hasAlbedo && hasNormal))
  private val point     = io.point
  private val parts     = Seq(point.distance, point.pixel, point.normal, point.albedo)
  moves := isReady && !isPending.asUInt.orR
  for ((pending, (part, isAlways)) <- isPending.zip(parts.zip(Seq(true, true, false, false)))) {
    part.valid := pending
    when(moves) { pending := isAlways.B || isHit }.elsewhen(part.ready) { pending := false.B }
  }
  private val bits = Wire(new DirectDistance(config))
  bits.isHit          := isHit
  bits.mayHide        := hit.kind === HitKind.map && !hit.isHidden
  bits.distance       := Mux(toMaps, sum, divider.quotient.bits)
  bits.exponent       := Mux(toMaps, Mux(isLater, hit.way.exponent, hit.exponent) + 1.S, hit.exponent)
  point.distance.bits := latch(bits, moves)
  point.origin        := latch(item.order.ray.origin, moves)
  private val pixel = point.pixel.bits
  pixel.request                                                 := latch(request, moves)
  pixel.hitDistance                                             := latch(item.order.hitDistance, moves)
  for ((to, from) <- pixel.dir.zip(item.order.ray.dir.axes)) to := latch(from, moves)
  point.normal.bits                                             := latch(normal, moves).asTypeOf(point.normal.bits)
  point.albedo.bits                                             := latch(albedo, moves).asTypeOf(point.albedo.bits)

  /** Half the number, shifted right. */
  private def down(number: UInt, by: SInt): UInt = {
    val isAll = by >= (f + 1).S
    Mux(isAll, 0.U, (number >> 1) >> by.asUInt(log2Ceil(f + 2) - 1, 0))
  }
}
