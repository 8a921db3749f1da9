package colonnade.shading

import chisel3._
import chisel3.util.Queue
import chisel3.util.random.LFSR
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Rgb, Vec3}
import colonnade.numbers.Fixed
import colonnade.TestParts._

/** Drives the inputs of the shader and reads its outputs. */
object ShaderDriver {
  import ResultPacking._

  private def pokeFixed(port: Fixed, raw: BigInt): Unit = port.raw match {
    case signed: SInt => signed.poke(raw)
    case other        => other.asInstanceOf[UInt].poke(raw)
  }

  private def pokeVector(port: Vec3[Fixed], raw: Seq[BigInt]): Unit =
    port.axes.zip(raw).foreach { case (to, value) => pokeFixed(to, value) }

  private def pokeColour(port: Rgb[UInt], raw: Seq[BigInt]): Unit =
    port.channels.zip(raw).foreach { case (to, value) => to.poke(value) }

  def pokeLight(io: ShaderIO, light: LightCase): Unit = {
    for ((port, source) <- io.lights.zip(light.sources)) {
      port.position.axes.zip(source.position).foreach { case (to, value) => to.poke(value) }
      port.colour.channels.zip(source.colour).foreach { case (to, value) => pokeFixed(to, value) }
      port.reachMantissa.poke(source.reachMantissa)
      port.reachExponent.poke(source.reachExponent)
    }
    io.unitShift.poke(light.unitShift)
    io.shading.offset.poke(light.offset)
    io.shading.lights.poke(light.shining)
    io.shading.flat.poke(light.isFlat)
    io.shading.shadows.poke(light.shadows)
    io.materials.zip(light.albedos).foreach { case (to, value) => pokeColour(to.albedo, value) }
    for ((material, claim) <- io.materials.zip(light.cornerColoured); port <- material.hasCornerColours)
      port.poke(claim)
    for ((material, claim) <- io.materials.zip(light.textured); port <- material.hasTexture) port.poke(claim)
  }

  def pokeHit(port: ShadeRequest, hit: HitCase): Unit = {
    port.context.poke(hit.context)
    port.ray.orientation.axis.poke(hit.axis)
    port.ray.orientation.negative.zip(hit.negative).foreach { case (to, value) => to.poke(value) }
    port.ray.origin.zip(hit.origin).foreach { case (to, value) => pokeFixed(to, value) }
    port.ray.shear.zip(hit.shear).foreach { case (to, value) => pokeFixed(to, value) }
    pokeFixed(port.hit.t, hit.t)
    port.hit.weights.zip(hit.weights).foreach { case (to, value) => pokeFixed(to, value) }
    port.hit.backSide.poke(hit.backSide)
    port.face.normals.zip(hit.normals).foreach { case (to, value) => pokeVector(to, value) }
    pokeVector(port.face.geometricNormal, hit.geometricNormal)
    for (colours <- port.face.colours; (to, value) <- colours.zip(hit.colours)) pokeColour(to, value)
    port.face.material.poke(hit.material)
  }

  def pokePoint(port: EnvironmentSurface, point: EnvironmentPointCase): Unit = {
    port.context.poke(point.context)
    pokeVector(port.point, point.point)
    port.normal.axes.zip(point.normal).foreach { case (to, value) => to.poke(value) }
    pokeColour(port.albedo, point.albedo)
    port.shadows.poke(point.shadows)
  }

  def peek(port: LitSurface): BigInt = pack(
    port.origin.axes.map(_.integer.peekInt()) ++
      port.directLight.zip(port.needsShadowRays).flatMap { case (direct, needs) =>
        direct.channels.map(_.natural.peekInt()) :+ needs.peekInt()
      } ++ port.albedo.channels.map(_.peekInt()) :+ port.context.peekInt()
  )
}

/** A shader, with a texture whose texels are made of their position and come in order, after a random time. */
final class ShaderHarness(config: ColonnadeConfig) extends Module {
  val io = IO(new ShaderIO(config))

  private val unit   = Module(Shader(config))
  private val shader = unit.io
  io <> shader

  /** The unit that the factory has chosen. */
  val leaf: String = unit.desiredName

  for ((port, unused) <- shader.texture.zip(io.texture)) {
    val random = LFSR(8)
    val asked  = Module(new Queue(chiselTypeOf(port.req.bits), 4)).io
    val pixel  = asked.deq.bits
    val texel  = port.resp.bits.colour
    unused.req.valid         := false.B
    unused.req.bits          := DontCare
    asked.enq.valid          := port.req.valid && random(1)
    asked.enq.bits           := port.req.bits
    port.req.ready           := asked.enq.ready && random(1)
    asked.deq.ready          := random(2, 0) === 0.U
    port.resp.valid          := asked.deq.fire
    port.resp.bits.isIllegal := false.B
    texel.r                  := pixel.x
    texel.g                  := pixel.y
    texel.b                  := pixel.x ^ pixel.y
  }
}

object ShaderHarness {

  /** The texel at a position, whose red and green have three fraction bits. */
  def texel(position: Seq[BigInt]): Seq[BigInt] = {
    val Seq(x, y) = position.take(2).map(_ >> 3)
    Seq(x, y, x ^ y)
  }
}

/** Packs a result's numbers into one integer, so that streams of results are compared as a whole. */
object ResultPacking {

  /** Bits of each number's field. */
  private val fieldBits = 96

  def pack(numbers: Seq[BigInt]): BigInt =
    numbers.reverse.foldLeft(BigInt(0))((all, number) => (all << fieldBits) + number + (BigInt(1) << (fieldBits - 1)))

  def unpack(all: BigInt, count: Int): Seq[BigInt] =
    Seq.tabulate(count)(i =>
      ((all >> (i * fieldBits)) & ((BigInt(1) << fieldBits) - 1)) - (BigInt(1) << (fieldBits - 1))
    )
}
