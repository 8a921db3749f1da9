package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.environment.{EnvironmentRay, MarchCase}
import colonnade.ray.RayRequest
import colonnade.shading.EnvironmentSurface
import colonnade.{Packed, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Each primary ray goes to the object or past it, once, and every ray that may march is stored, beside those of
  * bounces.
  */
class EnvironmentPortSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "EnvironmentPort"

  private val config = TestConfigs.withEnvironment(TestConfigs.environment)

  /** A ray without its context; its direction is scaled. */
  private def asStored(ray: Map[String, BigInt]): Map[String, BigInt] = {
    val names = Seq("x", "y", "z").map(axis => s"dir.$axis")
    ray - "context" - "isShadow" ++ names.zip(MarchCase.scaled(names.map(ray), config.numbers.shadeBits))
  }

  it should "route each primary ray once, and store the last ray of each context" in
    test(new EnvironmentPortHarness(config)).withAnnotations(Simulation.verilator) { dut =>
      val random               = new Random(4)
      val rays                 = new Packed(new RayRequest(config))
      val contexts             = config.units.pathContexts
      val port                 = dut.io
      var stored               = Map.empty[Int, Map[String, BigInt]]
      var (objects, bypassing) = (0, 0)
      dut.clock.setTimeout(0)
      port.view.enabled.poke(true)
      port.view.isMapCamera.poke(true)
      port.surfaces.ready.poke(false)

      def anyRay(): Map[String, BigInt] = {
        val shift = random.nextInt(config.numbers.directionBits)
        rays.unpack(BigInt(rays.width, random)).map {
          case (name, value) if name.startsWith("dir.") => name -> (value >> shift)
          case other                                    => other
        }
      }
      var offered = Option.empty[Map[String, BigInt]]
      for (_ <- 0 until 600) {
        if (offered.isEmpty && random.nextBoolean()) {
          offered = Some(anyRay() + ("context" -> BigInt(random.nextInt(contexts))))
          port.meetsObject.poke(random.nextBoolean())
          port.pixel.x.poke(random.nextInt(600))
          dut.primary.poke(rays.pack(offered.get))
        }
        port.primary.valid.poke(offered.nonEmpty)
        val bounced = Option.when(random.nextInt(3) == 0) {
          val context = random.shuffle((0 until contexts).filterNot(c => offered.exists(_("context") == c)).toList).head
          anyRay() + ("context" -> BigInt(context))
        }
        port.bounces.get.ray.valid.poke(bounced.nonEmpty)
        port.bounces.get.marches.poke(true)
        bounced.foreach(fields => dut.bounce.poke(rays.pack(fields)))
        port.objectRays.ready.poke(random.nextBoolean())

        val isTaken = offered.nonEmpty && port.primary.ready.peekBoolean()
        val meets   = port.meetsObject.peekBoolean()
        assert(!(isTaken && bounced.nonEmpty), "one ray is stored in a cycle")
        assert((port.objectRays.valid.peekBoolean() && port.objectRays.ready.peekBoolean()) == (isTaken && meets))
        port.control.bypass.valid.expect(isTaken && !meets)
        for (fields <- bounced) stored += fields("context").toInt -> asStored(fields)
        for (fields <- offered if isTaken) {
          port.objectRays.bits.context.expect(fields("context"))
          port.control.bypass.bits.expect(fields("context"))
          stored += fields("context").toInt -> (asStored(fields) + ("pixel.x" -> port.pixel.x.peekInt()))
          if (meets) objects += 1 else bypassing += 1
          offered = None
        }
        dut.clock.step()
      }
      assert(objects > 40 && bypassing > 40)

      // Ask for them
      port.primary.valid.poke(false)
      port.bounces.get.ray.valid.poke(false)
      port.marches.march.ready.poke(true)
      for ((context, expected) <- stored) {
        port.control.req.valid.poke(true)
        port.control.req.bits.context.poke(context)
        port.control.req.ready.expect(true)
        dut.clock.step()
        port.control.req.valid.poke(false)
        port.marches.march.valid.expect(true)
        dut.clock.step()
        val found = new Packed(new EnvironmentRay(config)).unpack(dut.order.peekInt())
        for ((name, value) <- expected) assert(found(name) == value, s"$name of context $context")
      }
      assert(stored.size == contexts)
    }

  it should "give a point to the shader once more, after the path from it has gathered" in {
    val gathering = TestConfigs.gathering(config)
    test(new EnvironmentPortHarness(gathering)).withAnnotations(Simulation.verilator) { dut =>
      val random  = new Random(5)
      val points  = new Packed(new EnvironmentSurface(gathering))
      val rays    = new Packed(new RayRequest(gathering))
      val port    = dut.io
      val march   = port.marches.answer
      val context = BigInt(1)
      dut.clock.setTimeout(0)
      port.view.enabled.poke(true)
      port.surfaces.ready.poke(true)

      def shaded(): Seq[BigInt] = Seq.fill(8) {
        val point = Option.when(port.surfaces.valid.peekBoolean())(dut.surface.peekInt())
        dut.clock.step()
        point
      }.flatten
      for (_ <- 0 until 40) {
        val point = points.pack(points.unpack(BigInt(points.width, random)) + ("context" -> context))
        march.valid.poke(true)
        march.bits.isHit.poke(true)
        dut.point.poke(point)
        march.ready.expect(true)
        dut.clock.step()
        march.valid.poke(false)
        assert(shaded() == Seq(point))
        port.bounces.get.ray.valid.poke(true)
        port.bounces.get.marches.poke(false)
        dut.bounce.poke(rays.pack(rays.unpack(BigInt(rays.width, random)) + ("context" -> context)))
        assert(shaded().isEmpty)
        port.bounces.get.ray.valid.poke(false)
        port.control.again.valid.poke(true)
        port.control.again.bits.poke(context)
        dut.clock.step()
        port.control.again.valid.poke(false)
        assert(shaded() == Seq(point))
      }
    }
  }
}

/** Packs rays into one port each. */
private class EnvironmentPortHarness(config: ColonnadeConfig) extends Module {
  private val unit = Module(new EnvironmentPort(config)).io

  val io      = IO(chiselTypeOf(unit))
  val primary = IO(Input(UInt(unit.primary.bits.getWidth.W)))
  val bounce  = IO(Input(UInt(unit.bounces.get.ray.bits.getWidth.W)))
  val order   = IO(Output(UInt(unit.marches.order.ray.getWidth.W)))
  val point   = IO(Input(UInt(unit.surfaces.bits.getWidth.W)))
  val surface = IO(Output(UInt(unit.surfaces.bits.getWidth.W)))
  io :<>= unit
  unit.primary.bits         := primary.asTypeOf(unit.primary.bits)
  unit.bounces.get.ray.bits := bounce.asTypeOf(unit.bounces.get.ray.bits)
  order                     := unit.marches.order.ray.asUInt

  unit.marches.answer.bits.surface := point.asTypeOf(unit.surfaces.bits)
  surface                          := unit.surfaces.bits.asUInt
}
