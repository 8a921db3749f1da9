package colonnade.shading

import chisel3.util.Valid
import chisel3.{Data, UInt}
import chiseltest._
import colonnade.RandomPorts.{peek, randomise}
import colonnade.TestConfigs
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** Surfaces leave in order, each with what came for it, and with the light of its own lights only. */
class LitAssemblerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "LitAssembler"

  private val queueDepth = 5
  private val gathering  = TestConfigs.gathering(TestConfigs.withEnvironment(TestConfigs.environment))
  private val emitting   = gathering.copy(frame = gathering.frame.copy(lights = 3, emission = true))

  /** The fields of a lit surface, whose colour comes from one of its sources, and the lights that came so far. */
  private class Surface(val lights: Int, val colouredBy: String) {
    val fields = mutable.Map.empty[String, Seq[BigInt]]
    val direct = mutable.Buffer.empty[Seq[BigInt]]
    val needs  = mutable.Buffer.empty[BigInt]

    def all(lights: Int): Map[String, Seq[BigInt]] = fields.toMap +
      ("directLight"     -> direct.padTo(lights, Seq.fill(3)(BigInt(0))).flatten.toSeq) +
      ("needsShadowRays" -> needs.padTo(lights, BigInt(0)).toSeq)
  }

  for ((config, name) <- Seq(emitting -> "points of an environment", TestConfigs.withTextures -> "textures"))
    it should s"put each surface together with its own lights, with $name" in
      test(new LitAssembler(config, queueDepth))(run(_, config, new Random(61)))

  private def run(dut: LitAssembler, config: ColonnadeConfig, random: Random): Unit = {
    val io                 = dut.io
    val lights             = mutable.Queue.empty[(Surface, Int)] // that have not come yet
    val colours            = mutable.Queue.empty[Surface]
    val texels             = mutable.Queue.empty[Surface]
    val expected           = mutable.Queue.empty[Surface]
    var (left, free, idle) = (60, queueDepth, 0)
    var isHeld             = false
    def isWilling          = random.nextInt(3) > 0
    def comes(part: Valid[_ <: Data], isNow: Boolean): Seq[BigInt] = {
      part.valid.poke(isNow)
      if (isNow) randomise(part.bits, random) else Nil
    }
    def source(part: Valid[_ <: Data], waiting: mutable.Queue[Surface], name: String): Unit = {
      val surface = Option.when(waiting.nonEmpty && isWilling)(waiting.dequeue())
      val colour  = comes(part, surface.nonEmpty)
      surface.filter(_.colouredBy == name).foreach(_.fields("albedo") = colour)
    }
    randomise(io.materials, random)
    while (left + expected.size > 0) {
      // Its label comes with the first of its lights at the latest
      val count  = 1 + random.nextInt(config.frame.lights)
      val starts = left > 0 && free >= count && isWilling
      comes(io.label, starts)
      val origin  = io.origin.flatMap(comes(_, starts))
      val scatter = io.scatter.map(_.flatMap(comes(_, starts)))
      if (starts) {
        val label                  = io.label.bits
        val material               = io.materials(label.material.peekInt().toInt)
        def is(flag: Option[UInt]) = flag.exists(_.peekInt() == 1)
        val isPoint                = is(label.environment.map(_.valid))
        val by                     =
          if (isPoint) "point"
          else if (is(material.hasTexture)) "texel"
          else if (is(material.hasCornerColours)) "corners" else "material"
        val surface = new Surface(count, by)
        surface.fields ++= Seq("context" -> peek(label.context), "origin" -> origin)
        if (by == "material") surface.fields("albedo") = peek(material.albedo)
        if (by == "point") surface.fields("albedo") = peek(label.environment.get.bits)
        scatter.foreach(surface.fields("scatter") = _)
        for (emission <- material.emission)
          surface.fields("emission") = if (isPoint) Seq.fill(3)(BigInt(0)) else peek(emission)
        surface.fields("isOfEnvironment") = Seq(if (isPoint) 1 else 0)
        lights ++= (0 until count).map(surface -> _)
        colours ++= Option.when(config.geometry.cornerColours)(surface)
        texels ++= Option.when(by == "texel")(surface)
        expected += surface
        left -= 1
        free -= count
      }
      val light = Option.when(lights.nonEmpty && isWilling)(lights.dequeue())
      comes(io.light, light.nonEmpty)
      for ((surface, index) <- light) {
        io.light.bits.light.poke(index)
        io.light.bits.isLast.poke(index == surface.lights - 1)
        surface.direct += peek(io.light.bits.direct)
        surface.needs ++= peek(io.light.bits.needsShadowRay)
      }
      io.albedo.colour.foreach(source(_, colours, "corners"))
      io.albedo.texel.foreach(source(_, texels, "texel"))

      val accepts = isWilling
      io.lit.ready.poke(accepts)
      val isOffered = io.lit.valid.peekBoolean()
      assert(isOffered || !isHeld, "an offer was withdrawn")
      if (isOffered) {
        val found = io.lit.bits.elements.map { case (name, field) => name -> peek(field) }.toMap
        assert(found == expected.head.all(config.frame.lights), s"with $left surfaces left")
        if (accepts) expected.dequeue()
      }
      isHeld = isOffered && !accepts
      if (io.isTaken.peekBoolean()) free += 1
      idle = if (isOffered) 0 else idle + 1
      assert(idle < 100, s"nothing leaves with $left surfaces left")
      dut.clock.step()
    }
    assert(free == queueDepth, "a light has not left")
  }
}
