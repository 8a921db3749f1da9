package colonnade.formats

import chisel3._
import colonnade.config.{ColonnadeConfig, ConfigIO}
import colonnade.{ArbitraryConfig, Packed, Properties}
import chiseltest._
import org.scalacheck.{Gen, Prop}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** Splits records by Chisel's own cast, as a reference for the layouts. */
private class CastHarness(config: ColonnadeConfig) extends Module {
  private val formats = new RecordFormats(config)

  val record = IO(Input(formats.record))
  val kinds  = formats.kinds.map { case (name, kind) => IO(Output(kind)).suggestName(name) }
  kinds.foreach(kind => kind := record(kind.getWidth - 1, 0).asTypeOf(kind))
}

class LayoutSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers with Properties {
  behavior of "Layout"

  private val variants: Seq[ColonnadeConfig] = Seq(
    Nil,
    Seq("geometry.cornerColours=true"),
    Seq("geometry.cornerColours=true", "geometry.textureBytes=16384"),
    Seq("geometry.vertexBits=19", "geometry.boxBits=4", "columnBvhMemory.depth=16"),
    Seq("geometry.vertexBits=10", "geometry.boxBits=7", "precision=16b16s16d", "geometry.triangleBits=null"),
    Seq(
      "precision=64b64s64d",
      "geometry.triangleBits=null",
      "frame.materials=1",
      "frame.hits=false",
      "columnBvhMemory.depth=4194304"
    )
  ).map(ConfigIO.load("tiny", _))

  private def kinds(config: ColonnadeConfig): Seq[Data] = {
    val formats = new RecordFormats(config)
    formats.kinds.map(_._2) ++ Seq(new Pixel(config), new Load(config)) ++
      Seq(new FrameRegisters(config), new DeviceStatus(config)) ++ AttributeMemories.layouts.map { case (_, kind) =>
        kind()
      }
  }

  it should "cover each bit of a type once, under unique names" in {
    for (config <- variants) coverEachBit(config)
  }

  it should "cover each bit of a type once, of any configuration" in holds(cases = 60) {
    Prop.forAll(ArbitraryConfig.legal) { config =>
      coverEachBit(config)
      true
    }
  }

  private def coverEachBit(config: ColonnadeConfig): Unit = for (kind <- kinds(config)) {
    val fields = Layout.of(kind).sortBy(_.offset)
    fields.map(_.offset) shouldBe fields.scanLeft(0)(_ + _.width).init
    fields.last.end shouldBe kind.getWidth
    fields.map(_.name).distinct.size shouldBe fields.size
  }

  it should "read back the numbers of any record" in holds(cases = 60) {
    def number(field: Field): Gen[BigInt] = {
      val lowest = if (field.signed) -(BigInt(1) << (field.width - 1)) else BigInt(0)
      Gen.oneOf(Gen.const(lowest), Gen.choose(lowest, lowest + (BigInt(1) << field.width) - 1))
    }
    val records = for {
      config <- ArbitraryConfig.legal
      formats = new RecordFormats(config)
      kind   <- Gen.oneOf(formats.kinds.map(_._2))
      values <- Gen.sequence[Seq[BigInt], BigInt](Layout.of(kind).map(number))
    } yield (kind, Layout.of(kind).map(_.name).zip(values).toMap)
    Prop.forAllNoShrink(records) { case (kind, values) =>
      val packed = new Packed(kind)
      packed.unpack(packed.pack(values)) == values
    }
  }

  it should "lay out the words of the environment's maps as their encoder packs them" in {
    def places(kind: Data): Map[String, (Int, Int)] =
      Layout.of(kind).map(field => field.name -> (field.offset, field.width)).toMap
    places(new MapDescriptor) shouldBe
      Map("mode" -> (0, 3), "pointer" -> (3, 13), "entries[0]" -> (16, 8), "entries[1]" -> (24, 8))
    places(new AlbedoEntry) shouldBe Map("r" -> (0, 12), "g" -> (12, 12), "b" -> (24, 12))
    places(new NormalEntry) shouldBe Map("x" -> (0, 12), "y" -> (12, 12), "z" -> (24, 12))
    places(new PlaneDescriptor) shouldBe Map("mode" -> (0, 3), "pointer" -> (3, 13))
    places(new Plane) shouldBe Map("a" -> (0, 20), "b" -> (20, 20), "c" -> (40, 20), "exponent" -> (60, 4))
    val shell = places(new BoundingPlaneEntry)
    Seq("plane.a", "albedo.r", "normal.x").map(shell(_)._1) shouldBe Seq(0, 64, 100)
  }

  it should "fit every kind of record into whole words" in {
    new RecordFormats(variants.head).recordBits shouldBe 256
    holds(cases = 60) {
      Prop.forAll(ArbitraryConfig.legal) { config =>
        val formats = new RecordFormats(config)
        formats.recordBits % 32 == 0 &&
        formats.kinds.forall(_._2.getWidth <= formats.recordBits)
      }
    }
  }

  it should "let the largest exponent reach across the cube" in holds(cases = 200) {
    Prop.forAll(ArbitraryConfig.legal) { config =>
      val largest = (1 << RecordFormats.exponentBits(config)) - 1
      val reach   = ((BigInt(1) << config.geometry.boxBits) - 1) << largest
      reach >= (BigInt(1) << config.geometry.vertexBits) - 1
    }
  }

  it should "agree with Chisel's own layout" in {
    val random = new Random(7)
    for (config <- variants) test(new CastHarness(config)) { unit =>
      for (_ <- 0 until 5) {
        val bits = BigInt(unit.record.getWidth, random)
        unit.record.poke(bits)
        for (kind <- unit.kinds; field <- Layout.of(kind)) {
          val raw   = (bits >> field.offset) & ((BigInt(1) << field.width) - 1)
          val value = if (field.signed && raw.testBit(field.width - 1)) raw - (BigInt(1) << field.width) else raw
          withClue(s"${field.name}: ")(LayoutSpec.number(kind, field.name).peek().litValue shouldBe value)
        }
      }
    }
  }
}

private object LayoutSpec {

  /** The element of a flattened name. */
  def number(data: Data, name: String): Bits =
    name.split("[.\\[\\]]+").filter(_.nonEmpty).foldLeft(data) {
      case (vector: Vec[_], index) => vector(index.toInt)
      case (record: Record, field) => record.elements(field)
      case (other, part)           => throw new NoSuchElementException(s"$part in $other")
    } match {
      case bits: Bits                     => bits
      case fixed: colonnade.numbers.Fixed => fixed.raw
      case other                          => throw new NoSuchElementException(s"$name is $other")
    }
}
